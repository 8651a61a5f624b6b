import { Debounce } from '../browser/debounce.ts';
import { prefersReducedMotion } from '../browser/reduced_motion.ts';
import type { LinkLook } from '../model/posed_body.ts';
import type { ModelReport } from '../model/report.ts';
import { originOf } from '../model/vectors.ts';
import { Overlay } from '../overlays/overlay.ts';
import type { OverlayStyle } from '../overlays/robot_overlay.ts';
import type { KinematicTree } from '../twin/kinematic_tree.ts';
import type { OverlayReadings } from '../twin/overlay/reader.ts';
import type { Pose } from '../twin/playback/pose.ts';
import type {
  EyePlace,
  FollowMode,
  MouseStyle,
  PoseSource,
  RowView,
  SeenOverlay,
} from '../view/body_view.ts';
import { CameraRig } from '../view/camera_rig.ts';
import type { ViewName } from '../view/framing.ts';
import type { Insets } from '../view/insets.ts';
import { RenderLoop } from '../view/render_loop.ts';
import { layOutRow } from '../view/row_layout.ts';
import { LIGHT_COLORS, type LightColors } from './colors.ts';
import { LightPainter } from './painter.ts';
import { attachPointerInput } from './pointer_input.ts';
import { AdaptiveResolution } from './resolution.ts';
import { LightRobotNode } from './robot_node.ts';

/** After so long without motion the picture is drawn once more, finely. */
const REST_MS = 150;
/** How near a zoom may come, in radii of the robot: nearer the coarsest level shows its corners. */
const NEAREST = 1 / 2;

export interface LightOptions {
  readonly theme: 'dark' | 'light';
  /** Hears when motion begins or ceases to be shown with fewer pixels, because this device is slow. */
  readonly onSlow?: (slow: boolean) => void;
  /** Hears of every picture: for what stands over it. */
  readonly onDrawn?: () => void;
}

type Corner = [number, number, number];
type OnProgress = (receivedBytes: number, totalBytes: number) => void;

/**
 * The body, or some side by side, for a browser without 3D: the lowest level of detail, every pixel made by hand on a plain
 * canvas. The same robots, colours, signs, toggles and camera words as `RobotScene`, without a line of three.js.
 */
export class LightView implements RowView {
  readonly #host: HTMLElement;
  readonly #camera = new CameraRig({
    nearest: NEAREST,
    still: prefersReducedMotion,
    changed: () => this.#loop.request(),
  });
  readonly #painter = new LightPainter(this.#camera);
  readonly #sharpness = new AdaptiveResolution();
  readonly #loop = new RenderLoop(() => this.#draw());
  readonly #overlay: Overlay;
  readonly #resizes: ResizeObserver;
  readonly #letGo: () => void;
  readonly #onSlow: (slow: boolean) => void;
  readonly #onDrawn: () => void;
  #mouse: MouseStyle = 'orbit';
  #tones: LightColors;
  readonly #robots: LightRobotNode[] = [];
  /** The first: the one that the view is of. */
  readonly #robot: LightRobotNode;
  #triangles = 0;
  #pictureMs = 0;
  /** Once nothing moves any more, one last picture with smooth edges. */
  readonly #finely = new Debounce(REST_MS, () => {
    this.#fine = true;
    this.#loop.drawNow();
  });
  #fine = false;
  #width = 0;

  constructor(host: HTMLElement, options: LightOptions) {
    this.#onSlow = options.onSlow ?? (() => {});
    this.#onDrawn = options.onDrawn ?? (() => {});
    this.#host = host;
    this.#tones = LIGHT_COLORS[options.theme];
    const { canvas } = this.#painter;
    host.append(canvas);
    this.#overlay = new Overlay(host, this.#tones.signs);
    this.#letGo = attachPointerInput(canvas, this.#camera, () => this.#mouse);
    this.#robot = this.addRobot();
    this.#loop.add({ advance: (seconds) => this.#advance(seconds) });
    this.#resizes = new ResizeObserver(() => this.#resize());
    this.#resizes.observe(host);
    this.#resize();
  }

  get renderedFrames(): number {
    return this.#loop.renderedFrames;
  }

  get resting(): boolean {
    return this.#loop.resting && !this.#finely.pending;
  }

  get drawCalls(): number {
    return this.#robots.filter(({ figure }) => figure?.dressed === true).length;
  }

  get triangles(): number {
    return this.#triangles;
  }

  get signs(): SeenOverlay {
    return this.signsOf(this.#robot);
  }

  signsOf(robot: LightRobotNode): SeenOverlay {
    if (this.#overlay.make()) this.#loop.request();
    return { ...this.#overlay.shown(robot), ghostLinks: robot.ghostLinks };
  }

  /** How long the newest picture in motion took to draw. */
  get pictureMs(): number {
    return this.#pictureMs;
  }

  /** Pixels of the newest picture's shells, for each of CSS. */
  get pixelRatio(): number {
    return this.#painter.pixelRatio;
  }

  readonly finerBytes = null;

  async refine(): Promise<void> {}

  load(manifestUrl: string, onProgress: OnProgress): Promise<ModelReport> {
    return this.#robot.load(manifestUrl, onProgress);
  }

  play(source: PoseSource | null): void {
    this.#robot.play(source);
    this.#loop.wake();
  }

  wake(): void {
    this.#loop.wake();
  }

  setPose(pose: Pose, live: boolean): void {
    this.#robot.setPose(pose, live);
    this.#loop.wake();
  }

  setGrey(grey: boolean): void {
    this.#robot.setGrey(grey);
    this.#loop.wake();
  }

  get robots(): readonly LightRobotNode[] {
    return this.#robots;
  }

  addRobot(): LightRobotNode {
    const robot = new LightRobotNode({
      tones: () => this.#tones,
      placed: () => this.#placed(),
      framed: (eased) => this.#framed(eased),
      changed: () => this.#loop.request(),
    });
    this.#robots.push(robot);
    if (this.#robots.length > 1) this.#camera.home = 'front'; // from anywhere else they would hide each other
    this.#loop.add(robot);
    return robot;
  }

  topOf({ figure }: LightRobotNode): { x: number; y: number } | null {
    if (figure === null || this.#width === 0) return null;
    const { min, max } = figure.bounds();
    return this.#painter.place([(min[0] + max[0]) / 2, (min[1] + max[1]) / 2, max[2]]);
  }

  setTheme(name: 'dark' | 'light'): void {
    this.#tones = LIGHT_COLORS[name];
    for (const robot of this.#robots) robot.setTones(this.#tones);
    this.#overlay.setTones(this.#tones.signs);
    this.#loop.request();
  }

  setCover(cover: Insets): void {
    this.#camera.cover(cover);
  }

  showSigns(readings: OverlayReadings | null, manner?: OverlayStyle, of = this.#robot): void {
    this.#overlay.show(of, readings, manner);
    this.#loop.wake();
  }

  showGhost(joints: ReadonlyMap<string, number> | null, limbs: readonly string[] | null = null): void {
    this.#robot.showGhost(joints, limbs);
  }

  lockHeading(locked: boolean): void {
    this.#robot.lockHeading(locked);
  }

  look(view: ViewName): void {
    this.#camera.look(view);
  }

  get stand(): EyePlace | null {
    return this.#camera.stand;
  }

  standAt(place: EyePlace): void {
    this.#camera.standAt(place);
  }

  get eye(): EyePlace {
    return this.#camera.eye;
  }

  focus(link: string): void {
    const at = this.#robot.figure?.linkMatrix(link);
    if (at !== undefined) this.#camera.focus(originOf(at.elements));
  }

  orbit(left: number, up: number): void {
    this.#camera.orbit(left, up);
  }

  pan(dx: number, dy: number): void {
    this.#camera.pan(dx, dy);
  }

  zoom(factor: number): void {
    this.#camera.zoom(factor);
  }

  setMouse(style: MouseStyle): void {
    this.#mouse = style;
  }

  setFollow(mode: FollowMode): void {
    this.#camera.followMode = mode;
  }

  pick(clientX: number, clientY: number): string | null {
    const { figure } = this.#robot;
    if (figure === null) return null;
    const { left, top } = this.#painter.canvas.getBoundingClientRect();
    return this.#painter.pick(figure, clientX - left, clientY - top);
  }

  tree(): KinematicTree | null {
    return this.#robot.tree();
  }

  setLinkLook(link: string, look: LinkLook): void {
    this.#robot.setLinkLook(link, look);
  }

  linkPoses(): Record<string, number[]> {
    return this.#robot.linkPoses();
  }

  dispose(): void {
    for (const robot of this.#robots) robot.dispose();
    this.#finely.cancel();
    this.#loop.stop();
    this.#resizes.disconnect();
    this.#letGo();
    this.#overlay.dispose();
    this.#painter.canvas.remove();
  }

  #placed(): void {
    const figures = this.#robots.flatMap(({ figure }) => figure ?? []);
    if (figures.length > 0) {
      const mean = (axis: 'x' | 'y') =>
        figures.reduce((sum, { spot }) => sum + spot[axis], 0) / figures.length;
      const heading = this.#robots.length === 1 ? this.#robot.heading : 0; // several look nowhere together
      this.#camera.follow(mean('x'), mean('y'), heading);
    }
    this.#overlay.moved();
    this.#loop.request();
  }

  #framed(eased: boolean): void {
    if (this.#robots.length > 1) layOutRow(this.#robots);
    const boxes = this.#robots.flatMap(({ figure }) => figure?.bounds() ?? []);
    if (boxes.length === 0) return;
    const far = (corner: 'min' | 'max') =>
      [0, 1, 2].map((axis) => Math[corner](...boxes.map((box) => box[corner][axis]!))) as Corner;
    this.#camera.frame(far('min'), far('max'), eased);
    this.#overlay.measure();
    this.#loop.request();
  }

  #advance(seconds: number): boolean {
    const gliding = this.#overlay.advance(seconds);
    if (this.#overlay.make()) this.#loop.request();
    this.#camera.advance(seconds);
    if (this.#width > 0) this.#overlay.placeLabels(this.#painter.place, this.#width);
    return gliding || this.#camera.moving;
  }

  #resize(): void {
    const { clientWidth, clientHeight } = this.#host;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.#width = clientWidth;
    this.#painter.resize(clientWidth, clientHeight);
    this.#camera.resize(clientWidth, clientHeight);
    this.#overlay.placeLabels(this.#painter.place, this.#width);
    this.#loop.drawNow();
  }

  #draw(): boolean {
    if (this.#width === 0) return false;
    const begunMs = performance.now();
    if (this.#overlay.make()) this.#overlay.placeLabels(this.#painter.place, this.#width); // robots may have moved since the last tick
    const fine = this.#fine;
    this.#fine = false;
    this.#triangles = this.#painter.paint({
      robots: this.#robots,
      strokes: this.#overlay.strokes,
      tones: this.#tones,
      ratio: this.#sharpness.ratio(Math.max(1, window.devicePixelRatio), fine),
      fine,
    });
    this.#onDrawn();
    if (!fine) {
      this.#pictureMs = performance.now() - begunMs;
      const { reduced } = this.#sharpness;
      this.#sharpness.took(this.#pictureMs);
      if (reduced !== this.#sharpness.reduced) this.#onSlow(!reduced);
      this.#finely.restart();
    }
    return true;
  }
}
