import { type Camera, NeutralToneMapping, type Scene, VSMShadowMap, WebGLRenderer } from 'three';

const MAX_PIXEL_RATIO = 2;

/** The canvas and its WebGL renderer: handles size, pixel ratio, and the loss of the WebGL context. */
export class SceneCanvas {
  readonly canvas: HTMLCanvasElement;
  readonly renderer: WebGLRenderer;
  readonly #host: HTMLElement;
  readonly #resizes: ResizeObserver;
  readonly #on: SceneCanvasEvents;
  #sharpness = 1;

  /** Throws an Error with a user-facing message if the browser has no WebGL 2. */
  constructor(host: HTMLElement, on: SceneCanvasEvents) {
    this.#host = host;
    this.#on = on;
    this.canvas = document.createElement('canvas');
    const context = this.canvas.getContext('webgl2', { antialias: true, alpha: false });
    if (context === null) throw new Error('This browser has no 3D. The table shows all readings.');
    this.renderer = new WebGLRenderer({ canvas: this.canvas, context });
    this.renderer.toneMapping = NeutralToneMapping; // keeps the URDF's colours and compresses only highlights
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

  /** Sets the fraction (0…1) of the screen's pixels along each side at which the next pictures are drawn. */
  set sharpness(part: number) {
    if (part === this.#sharpness) return;
    this.#sharpness = part;
    this.fit();
  }

  /** Makes the canvas as large as its host, which clears it. Does nothing and returns false while the host has no size. */
  fit(): boolean {
    const { clientWidth, clientHeight } = this.#host;
    if (clientWidth === 0 || clientHeight === 0) return false;
    const ratio = Math.min(window.devicePixelRatio, MAX_PIXEL_RATIO) * this.#sharpness;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(clientWidth, clientHeight);
    this.#on.resized(clientWidth, clientHeight, ratio);
    return true;
  }

  /** Disposes of a scene's GPU objects after a lost context: otherwise three.js would later delete them in the new one, with a
   *  warning for each. */
  forget(scene: Scene): void {
    scene.traverse((object) => {
      if (!('geometry' in object && 'material' in object)) return;
      for (const held of [object.geometry, object.material].flat()) (held as { dispose(): void }).dispose();
    });
  }

  /** Converts a point of the window (CSS pixels) to a point of the picture (x right, y up, −1…1). */
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
    event.preventDefault(); // otherwise the browser never frees it
    this.#on.lost();
  };
}

/** Callbacks of a `SceneCanvas`. */
export interface SceneCanvasEvents {
  /** The size in CSS pixels, and device pixels per CSS pixel. */
  resized(width: number, height: number, pixelRatio: number): void;
  /** The canvas has another size and is blank until it is drawn. */
  blank(): void;
  /** The WebGL context is lost, and all GPU objects with it. */
  lost(): void;
  /** There is a WebGL context again, without any GPU objects. */
  restored(): void;
}
