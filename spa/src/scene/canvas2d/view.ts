import { prefersReducedMotion } from '../../browser/painting.ts';
import { Debounce } from '../../kit.ts';

import { CameraRig } from '../camera/camera_rig.ts';
import type { DrawnSigns, Fingers } from '../figure/body_view.ts';
import type { NodeHost } from '../figure/figure_node.ts';
import { RobotRow, topOf } from '../figure/robot_row.ts';
import { RowStage } from '../figure/row_stage.ts';
import { Overlay } from '../signs/overlay.ts';
import type { RobotSigns } from '../signs/signs.ts';
import { LIGHT_COLORS, type LightColors } from './colors.ts';
import { LightPainter } from './painter.ts';
import { attachPointerInput } from './pointer_input.ts';
import { LightRobotNode } from './robot_node.ts';

/** A picture that takes longer counts as slow. */
const TOO_LONG_MS = 26;
/** A picture that takes less leaves time for more pixels. */
const SHORT_MS = 7;
/** This many slow pictures in a row lower the resolution; a single one may be an outlier. */
const LONG_IN_A_ROW = 4;
const SHORT_IN_A_ROW = 30;
/** Pixels per CSS pixel, along each side. */
const STEPS = [0.5, 0.75, 1, 1.5, 2] as const;
const USUAL = STEPS.indexOf(1);

/** Adapts the resolution of moving pictures to the drawing time of recent ones. Pictures at rest may take longer. */
export class AdaptiveResolution {
  #step = USUAL;
  #long = 0;
  #short = 0;

  /** The pixels per CSS pixel to draw with. `screen`: device pixels per CSS pixel. */
  ratio(screen: number, resting: boolean): number {
    // At rest, twice the screen's pixels are drawn, up to 2 per CSS pixel, which smooths edges.
    return resting ? Math.max(1, Math.min(2, screen * 2)) : Math.min(STEPS[this.#step]!, 2);
  }

  /** Whether motion is drawn with fewer pixels than usual. */
  get reduced(): boolean {
    return this.#step < USUAL;
  }

  took(ms: number): void {
    this.#long = ms > TOO_LONG_MS ? this.#long + 1 : 0;
    this.#short = ms < SHORT_MS ? this.#short + 1 : 0;
    if (this.#long === LONG_IN_A_ROW) this.#go(-1);
    else if (this.#short === SHORT_IN_A_ROW) this.#go(1);
  }

  #go(steps: number): void {
    this.#step = Math.min(STEPS.length - 1, Math.max(0, this.#step + steps));
    this.#long = this.#short = 0;
  }
}

/** After this long without motion the picture is drawn once more, with smooth edges. */
const REST_MS = 150;
/** Minimum distance of the camera, in radii of the robot: closer up, the coarsest level looks too rough. */
const NEAREST = 1 / 2;

export interface LightOptions {
  readonly theme: 'dark' | 'light';
  /** Called when the view switches to fewer pixels during motion because this device is slow, and when it switches back. */
  readonly onSlow?: (slow: boolean) => void;
  /** Called after every picture, so that elements over the canvas can follow. */
  readonly onDrawn?: () => void;
}

/**
 * The view of one or several robots for browsers without WebGL: the coarsest level of detail, rasterised in software on
 * a 2D canvas. It has the same interface, colours and overlay as `RobotScene`, without three.js.
 */
export class LightView extends RowStage<LightRobotNode> {
  protected override readonly row = new RobotRow<LightRobotNode>();
  /** Signs of balance are filled triangles, and this view draws only strokes. */
  readonly drawsBalance = false;
  readonly #host: HTMLElement;
  protected override readonly rig = new CameraRig({
    nearest: NEAREST,
    still: prefersReducedMotion,
    changed: () => this.loop.request(),
  });
  readonly #painter = new LightPainter(this.rig);
  readonly #sharpness = new AdaptiveResolution();
  readonly #overlay: Overlay;
  readonly #resizes: ResizeObserver;
  readonly #pointers: ReturnType<typeof attachPointerInput>;
  readonly #onSlow: (slow: boolean) => void;
  readonly #onDrawn: () => void;
  #tones: LightColors;
  #triangles = 0;
  #pictureMs = 0;
  /** Draws a final picture with smooth edges once nothing moves any more. */
  readonly #finely = new Debounce(REST_MS, () => {
    this.#fine = true;
    this.loop.drawNow();
  });
  #fine = false;
  #width = 0;

  constructor(host: HTMLElement, options: LightOptions) {
    super();
    this.#onSlow = options.onSlow ?? (() => {});
    this.#onDrawn = options.onDrawn ?? (() => {});
    this.#host = host;
    this.#tones = LIGHT_COLORS[options.theme];
    const { canvas } = this.#painter;
    host.append(canvas);
    this.#overlay = new Overlay(host, this.#tones.signs, this.drawsBalance);
    this.#pointers = attachPointerInput(canvas, this.rig);
    this.addRobot();
    this.loop.add({ advance: (seconds) => this.#advance(seconds) });
    this.#resizes = new ResizeObserver(() => this.#resize());
    this.#resizes.observe(host);
    this.#resize();
  }

  get resting(): boolean {
    return this.loop.resting && !this.#finely.pending;
  }

  get drawCalls(): number {
    return this.robots.filter(({ figure }) => figure?.dressed === true).length;
  }

  get triangles(): number {
    return this.#triangles;
  }

  setFingers(fingers: Fingers): void {
    this.#pointers.setFingers(fingers);
  }

  signsOf(robot: LightRobotNode): DrawnSigns {
    if (this.#overlay.make()) this.loop.request();
    return { ...this.#overlay.drawn(robot), ghostLinks: robot.ghostLinks };
  }

  /** How long the newest picture in motion took to draw, ms. */
  get pictureMs(): number {
    return this.#pictureMs;
  }

  /** Rasterised pixels per CSS pixel of the newest picture's meshes. */
  get pixelRatio(): number {
    return this.#painter.pixelRatio;
  }

  readonly finerBytes = null;

  async refine(): Promise<void> {}

  topOf(robot: LightRobotNode): { x: number; y: number } | null {
    const top = topOf(robot);
    return top === null || this.#width === 0 ? null : this.#painter.place(top);
  }

  setTheme(name: 'dark' | 'light'): void {
    this.#tones = LIGHT_COLORS[name];
    for (const robot of this.robots) robot.setTones(this.#tones);
    this.#overlay.setColors(this.#tones.signs);
    this.loop.request();
  }

  override showSigns(signs: RobotSigns, of: LightRobotNode = this.robot): void {
    super.showSigns(signs, of);
    this.#overlay.show(of, signs);
    this.loop.wake();
  }

  pick(clientX: number, clientY: number): string | null {
    const { figure } = this.robot;
    if (figure === null) return null;
    const { left, top } = this.#painter.canvas.getBoundingClientRect();
    return this.#painter.pick(figure, clientX - left, clientY - top);
  }

  dispose(): void {
    this.row.dispose();
    this.#finely.cancel();
    this.loop.stop();
    this.#resizes.disconnect();
    this.#pointers.stop();
    this.#overlay.dispose();
    this.#painter.canvas.remove();
  }

  protected override make(host: NodeHost): LightRobotNode {
    return new LightRobotNode({ ...host, tones: () => this.#tones });
  }

  protected override placed(): void {
    this.#overlay.moved();
    this.loop.request();
  }

  protected override framed(): void {
    this.#overlay.measure();
    this.loop.request();
  }

  #advance(seconds: number): boolean {
    const gliding = this.#overlay.advance(seconds);
    if (this.#overlay.make()) this.loop.request();
    this.rig.advance(seconds);
    if (this.#width > 0) this.#overlay.placeLabels(this.#painter.place, this.rig.projection);
    return gliding || this.rig.moving;
  }

  #resize(): void {
    const { clientWidth, clientHeight } = this.#host;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.#width = clientWidth;
    this.#painter.resize(clientWidth, clientHeight);
    this.rig.resize(clientWidth, clientHeight);
    this.#overlay.placeLabels(this.#painter.place, this.rig.projection);
    this.loop.drawNow();
  }

  protected override draw(): boolean {
    if (this.#width === 0) return false;
    const begunMs = performance.now();
    if (this.#overlay.make()) this.#overlay.placeLabels(this.#painter.place, this.rig.projection); // robots may have moved since the last tick
    const fine = this.#fine;
    this.#fine = false;
    this.#triangles = this.#painter.paint({
      robots: this.robots,
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
