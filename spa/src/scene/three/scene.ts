import { type Camera, Color, NeutralToneMapping, Scene, VSMShadowMap, WebGLRenderer } from 'three';
import { markOnce } from '../../browser/painting.ts';
import { Debounce } from '../../kit.ts';
import type { ModelReport } from '../../model/report.ts';
import type { LocalRobot } from '../../urdf/local_robot.ts';
import type { CameraRig } from '../camera/camera_rig.ts';
import { AdaptiveQuality, type DrawingTrouble } from '../figure/adaptive_quality.ts';
import type { DrawnSigns, Fingers } from '../figure/body_view.ts';
import type { NodeHost } from '../figure/figure_node.ts';
import type { QualityStep } from '../figure/quality_steps.ts';
import { RowStage } from '../figure/row_stage.ts';
import type { RobotSigns } from '../signs/signs.ts';
import { SceneCamera } from './camera.ts';
import { Environment, SHADOW_PIXELS } from './environment.ts';
import { OverlayPart } from './overlay_part.ts';
import { Placeholders } from './placeholder.ts';
import { RobotNode } from './robot_node.ts';
import { SceneRow } from './scene_row.ts';
import { warmUp } from './shader_warm_up.ts';
import type { SkinTones } from './skin.ts';
import { type SceneTheme, THEMES, type ThemeName } from './theme.ts';

const MAX_PIXEL_RATIO = 2;
const PLACEHOLDER_REACHES = 0.12;
/** After this long without motion, a picture drawn with fewer pixels is redrawn with all of them. */
const REST_MS = 500;

export interface SceneOptions {
  readonly theme: ThemeName;
  /** Called when a drawing problem appears or disappears; null: none. */
  readonly onTrouble?: (trouble: DrawingTrouble | null) => void;
  /** Called after every picture, so that elements over the canvas can follow. */
  readonly onDrawn?: () => void;
}

/**
 * The 3D view of one or several robots, in a world with Z up. It combines the content (`RobotNode`, `Environment`, `OverlayPart`),
 * the camera (`SceneCamera`), the canvas (`SceneCanvas`) and the timing (`RenderLoop`).
 */
export class RobotScene extends RowStage<RobotNode> {
  protected override readonly row = new SceneRow();
  protected override readonly rig: CameraRig;
  readonly drawsBalance = true;
  readonly #scene = new Scene();
  readonly #surface: SceneCanvas;
  readonly #camera: SceneCamera;
  readonly #environment = new Environment();
  readonly #placeholders = new Placeholders();
  readonly #overlay: OverlayPart;
  readonly #tones: SkinTones = { accent: { value: new Color() }, caution: { value: new Color() } };
  readonly #quality: AdaptiveQuality;
  readonly #onDrawn: () => void;
  #theme: SceneTheme;
  readonly #sharpen = new Debounce(REST_MS, () => {
    // A slow device may need longer than REST_MS for its next picture; it is then still in motion.
    if (!this.loop.resting) return this.#sharpen.restart();
    this.#surface.sharpness = 1;
    this.loop.drawNow();
  });
  #size = { width: 1, height: 1 };
  #cool: () => void = () => {};

  /** Throws an Error with a user-facing message if the browser has no WebGL 2. */
  constructor(host: HTMLElement, options: SceneOptions) {
    super();
    this.#quality = new AdaptiveQuality({
      applyStep: (step) => this.#applyStep(step),
      isCoarse: () => this.row.coarse,
      isReplaceable: () => this.row.built,
      report: options.onTrouble ?? (() => {}),
    });
    this.#onDrawn = options.onDrawn ?? (() => {});
    this.#theme = THEMES[options.theme];
    this.#surface = new SceneCanvas(host, {
      resized: (width, height, pixelRatio) => this.#resized(width, height, pixelRatio),
      blank: () => this.loop.drawNow(),
      lost: (isGivenBack) => {
        this.#surface.forget(this.#scene);
        this.#environment.forgetShadow();
        if (isGivenBack) this.#quality.contextGivenBack();
        else this.#quality.contextLost(performance.now());
      },
      requested: () => this.#quality.contextRequested(),
      restored: () => {
        this.#quality.contextRestored();
        this.#drawShadows();
      },
    });
    this.#camera = new SceneCamera(this.#surface.canvas, () => this.loop.request());
    this.rig = this.#camera.rig;
    this.#scene.add(this.#environment.group);
    this.addRobot();
    this.loop.add(this.rig);
    this.#overlay = new OverlayPart({
      host,
      camera: this.#camera.camera,
      room: () => this.rig.projection,
      changed: () => this.loop.request(),
      wake: () => this.loop.wake(),
    });
    this.#scene.add(this.#overlay.object);
    this.loop.add(this.#overlay);
    this.loop.onInterval = (ms) => this.#quality.recordRepaint(ms);
    this.setTheme(options.theme);
    if (this.#surface.fit()) this.loop.drawNow();
    const { renderer } = this.#surface;
    this.#cool = warmUp(renderer, this.#scene, this.#camera.camera, this.robot.staleEffect, this.#tones);
  }

  override setAsleep(asleep: boolean): void {
    this.#surface.setAsleep(asleep);
  }

  get resting(): boolean {
    return this.loop.resting && !this.#sharpen.pending;
  }

  /** Pixels drawn per CSS pixel, along each side. */
  get pixelRatio(): number {
    return this.#surface.renderer.getPixelRatio();
  }

  /** Draw calls of the newest picture, including shadows if they were redrawn. */
  get drawCalls(): number {
    return this.#surface.renderer.info.render.calls;
  }

  get triangles(): number {
    return this.#surface.renderer.info.render.triangles;
  }

  topOf(robot: RobotNode): { x: number; y: number } | null {
    const top = this.row.topOf(robot, this.#camera.camera);
    const { width, height } = this.#size;
    return top === null ? null : { x: ((top.x + 1) / 2) * width, y: ((1 - top.y) / 2) * height };
  }

  /** Like `load`, for a robot whose files are already in this browser. */
  loadLocal(robot: LocalRobot): Promise<ModelReport> {
    return this.robot.loadLocal(robot);
  }

  setFingers(fingers: Fingers): void {
    this.#camera.setFingers(fingers);
  }

  setTheme(name: ThemeName): void {
    const theme = THEMES[name];
    this.#theme = theme;
    this.#scene.background = theme.page;
    this.#surface.renderer.toneMappingExposure = theme.exposure;
    this.#environment.setTheme(theme);
    this.#placeholders.setColor(theme.caution);
    this.#tones.accent.value = theme.accent;
    this.#tones.caution.value = theme.caution;
    this.row.setTheme(theme);
    this.#overlay.setTheme(theme);
    this.loop.request();
  }

  get finerBytes(): number | null {
    return this.robot.finerBytes;
  }

  refine(onProgress: (receivedBytes: number, totalBytes: number) => void): Promise<void> {
    return this.robot.refine(onProgress);
  }

  /** Pans the world in the picture plane. */
  override pan(dx: number, dy: number): void {
    this.#camera.pan(dx, dy);
  }

  pick(clientX: number, clientY: number): string | null {
    return this.robot.pick(this.#camera.ray(this.#surface.place(clientX, clientY)));
  }

  override showSigns(signs: RobotSigns, of: RobotNode = this.robot): void {
    super.showSigns(signs, of);
    this.#overlay.show(of, signs);
  }

  signsOf(robot: RobotNode): DrawnSigns {
    return { ...this.#overlay.drawn(robot), ghostLinks: robot.ghostLinks };
  }

  /** Turns adaptive quality off and draws at full quality, for saved pictures. */
  keepSharp(): void {
    this.loop.onInterval = null;
    this.#quality.reset();
  }

  dispose(): void {
    this.loop.stop();
    this.#sharpen.cancel();
    this.#quality.dispose();
    this.#camera.dispose();
    this.#overlay.dispose();
    this.row.dispose();
    this.#placeholders.dispose();
    this.#environment.dispose();
    this.#cool();
    this.#surface.dispose();
  }

  protected override make(host: NodeHost): RobotNode {
    const robot = new RobotNode({
      ...host,
      tones: this.#tones,
      theme: () => this.#theme,
      placeholder: () => this.#placeholders.make(this.rig.reach * PLACEHOLDER_REACHES),
    });
    robot.staleEffect.setPixelRatio(this.pixelRatio);
    this.#scene.add(robot.object);
    return robot;
  }

  protected override placed(middle: { readonly x: number; readonly y: number } | null): void {
    if (middle !== null) {
      this.#environment.touch(this.row.boxes);
      this.#environment.follow(middle.x, middle.y, this.rig.middle.flies);
    }
    this.#overlay.follow();
    this.#drawShadows();
  }

  protected override framed(): void {
    this.#environment.resize(this.rig.reach);
    this.#overlay.measure();
    this.#drawShadows();
  }

  #drawShadows(): void {
    this.#surface.renderer.shadowMap.needsUpdate = true;
    this.loop.request();
  }

  #resized(width: number, height: number, pixelRatio: number): void {
    this.row.setPixelRatio(pixelRatio);
    if (this.#size.width === width && this.#size.height === height) return;
    this.#size = { width, height };
    this.rig.resize(width, height);
    this.#overlay.resize();
  }

  protected override draw(): boolean {
    const { pixels } = this.#quality;
    const moving = !this.loop.resting;
    if (pixels < 1 && moving) {
      this.#surface.sharpness = pixels;
      this.#sharpen.restart();
    }
    this.#overlay.prepare();
    this.#environment.axesShown = !this.#overlay.balanced;
    const drawn = this.#surface.render(this.#scene, this.#camera.camera);
    this.#onDrawn();
    if (drawn && this.robot.pose !== null && this.robot.figure !== null) {
      markOnce(this.robot.dressed ? 'posecast:skin' : 'posecast:skeleton');
      if (this.robot.dressed) this.#cool();
    }
    return drawn;
  }

  /** Uses this step's pixels, shadows and level of detail from now on. */
  #applyStep({ pixels, shadow, lowest }: QualityStep): void {
    this.#environment.shadowPixels = SHADOW_PIXELS * shadow;
    if (pixels === 1) this.#surface.sharpness = 1;
    this.row.keepCoarse(lowest);
    this.#drawShadows();
  }
}

/** The canvas and its WebGL renderer: handles size, pixel ratio, and the loss of the WebGL context. */
class SceneCanvas {
  readonly canvas: HTMLCanvasElement;
  readonly renderer: WebGLRenderer;
  readonly #host: HTMLElement;
  readonly #resizes: ResizeObserver;
  readonly #on: SceneCanvasEvents;
  #sharpness = 1;
  #asleep = false;
  /** The newest picture, while the context is given back and until the next one is drawn. */
  #still: HTMLCanvasElement | null = null;
  /** Whether this canvas itself gave its context back, and the browser has said that it is lost. */
  #isGivenBack = false;
  #isRestorable = false;

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
    this.canvas.addEventListener('webglcontextrestored', this.#onRestored);
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
    this.#still?.remove();
    this.#still = null;
    return true;
  }

  /** Gives the context back, or takes it again. A browser has about sixteen for all frames of a page, and takes the oldest away
   *  for the next. */
  setAsleep(asleep: boolean): void {
    this.#asleep = asleep;
    if (asleep) this.#giveBack();
    else this.#takeAgain();
  }

  #giveBack(): void {
    if (this.lost) return; // not now: see `#onRestored`
    this.#on.blank(); // a WebGL canvas can be read only right after drawing
    const still = document.createElement('canvas');
    still.width = this.canvas.width;
    still.height = this.canvas.height;
    still.style.cssText =
      'position: absolute; inset: 0; width: 100%; height: 100%; object-fit: cover; pointer-events: none';
    still.getContext('2d')?.drawImage(this.canvas, 0, 0);
    this.canvas.after(still);
    this.#still = still;
    this.#isGivenBack = true;
    this.#isRestorable = false;
    this.renderer.forceContextLoss();
  }

  /** A context can be restored only after the event that says that it is lost. */
  #takeAgain(): void {
    if (this.#asleep || !this.#isGivenBack || !this.#isRestorable) return;
    this.#isGivenBack = false;
    this.#on.requested();
    this.renderer.forceContextRestore();
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
    this.canvas.removeEventListener('webglcontextrestored', this.#onRestored);
    this.#still?.remove();
    this.renderer.dispose();
    this.#isGivenBack = false;
    if (!this.lost) this.renderer.forceContextLoss(); // a page may hold few contexts; don't wait for the garbage collector
    this.canvas.remove();
  }

  readonly #onLost = (event: Event): void => {
    event.preventDefault(); // otherwise the browser never frees it
    this.#on.lost(this.#isGivenBack);
    setTimeout(() => {
      this.#isRestorable = true;
      this.#takeAgain();
    });
  };

  readonly #onRestored = (): void => {
    this.#on.restored();
    if (this.#asleep) this.#giveBack();
  };
}

/** Callbacks of a `SceneCanvas`. */
interface SceneCanvasEvents {
  /** The size in CSS pixels, and device pixels per CSS pixel. */
  resized(width: number, height: number, pixelRatio: number): void;
  /** The canvas has another size and is blank until it is drawn. */
  blank(): void;
  /** The WebGL context is lost, and all GPU objects with it. `isGivenBack`: because nobody sees the canvas. */
  lost(isGivenBack: boolean): void;
  /** The context was asked for again. */
  requested(): void;
  /** There is a WebGL context again, without any GPU objects. */
  restored(): void;
}
