import { type Camera, NeutralToneMapping, type Scene, VSMShadowMap, WebGLRenderer } from 'three';

const MAX_PIXEL_RATIO = 2;

/** The canvas and what draws on it: its size, its pixels, and its context, which a browser may take away. */
export class SceneCanvas {
  readonly canvas: HTMLCanvasElement;
  readonly renderer: WebGLRenderer;
  readonly #host: HTMLElement;
  readonly #resizes: ResizeObserver;
  readonly #on: SceneCanvasEvents;
  #sharpness = 1;

  /** Throws an Error with a sentence for people when the browser has no WebGL. */
  constructor(host: HTMLElement, on: SceneCanvasEvents) {
    this.#host = host;
    this.#on = on;
    this.canvas = document.createElement('canvas');
    const context = this.canvas.getContext('webgl2', { antialias: true, alpha: false });
    if (context === null)
      throw new Error('This browser has no 3D. The table shows everything the robot says.');
    this.renderer = new WebGLRenderer({ canvas: this.canvas, context });
    this.renderer.toneMapping = NeutralToneMapping; // keeps the colours of the URDF, rolls off highlights only
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = VSMShadowMap;
    this.renderer.shadowMap.autoUpdate = false; // shadows change with the pose, not with the camera
    this.canvas.setAttribute('role', 'img');
    this.canvas.setAttribute('aria-label', '3D view of the robot');
    this.canvas.style.display = 'block';
    this.canvas.style.touchAction = 'none';
    host.append(this.canvas);
    this.canvas.addEventListener('webglcontextlost', this.#onLost);
    this.canvas.addEventListener('webglcontextrestored', on.restored);
    this.#resizes = new ResizeObserver(() => {
      if (this.fit()) this.#on.blank();
    });
    this.#resizes.observe(host);
  }

  get lost(): boolean {
    return this.renderer.getContext().isContextLost();
  }

  render(scene: Scene, camera: Camera): boolean {
    if (this.lost) return false;
    this.renderer.render(scene, camera);
    return true;
  }

  /** Draws the next picture with this part (0…1) of the screen's pixels along each side. */
  set sharpness(part: number) {
    if (part === this.#sharpness) return;
    this.#sharpness = part;
    this.fit();
  }

  /** Makes the canvas as large as its host, and blank; nothing and false while the host has no size. */
  fit(): boolean {
    const { clientWidth, clientHeight } = this.#host;
    if (clientWidth === 0 || clientHeight === 0) return false;
    const ratio = Math.min(window.devicePixelRatio, MAX_PIXEL_RATIO) * this.#sharpness;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(clientWidth, clientHeight);
    this.#on.resized(clientWidth, clientHeight, ratio);
    return true;
  }

  /** Forgets what of a scene lay in the lost context: three.js would later delete it in the new one, with a warning for each. */
  forget(scene: Scene): void {
    scene.traverse((object) => {
      if (!('geometry' in object && 'material' in object)) return;
      for (const held of [object.geometry, object.material].flat()) (held as { dispose(): void }).dispose();
    });
  }

  /** A point of the window (CSS pixels) as a point of the picture: both −1…1, right and up. */
  place(clientX: number, clientY: number): { x: number; y: number } {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    return { x: (2 * (clientX - left)) / width - 1, y: 1 - (2 * (clientY - top)) / height };
  }

  dispose(): void {
    this.#resizes.disconnect();
    this.canvas.removeEventListener('webglcontextlost', this.#onLost);
    this.canvas.removeEventListener('webglcontextrestored', this.#on.restored);
    this.renderer.dispose();
    this.renderer.forceContextLoss(); // a page may hold few contexts; don't wait for the garbage collector
    this.canvas.remove();
  }

  readonly #onLost = (event: Event): void => {
    event.preventDefault(); // or the browser never gives it back
    this.#on.lost();
  };
}

export interface SceneCanvasEvents {
  /** CSS pixels, and device pixels for each of them. */
  resized(width: number, height: number, pixelRatio: number): void;
  /** It has another size and shows nothing until it is drawn. */
  blank(): void;
  /** Everything that lay on the graphics card is gone. */
  lost(): void;
  /** There is an empty context again. */
  restored(): void;
}
