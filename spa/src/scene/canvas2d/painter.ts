import type { CameraRig } from '../camera/camera_rig.ts';
import { fadeOf } from '../camera/framing.ts';
import type { LabelPlace } from '../signs/labels.ts';
import type { Strokes } from '../signs/strokes.ts';
import { css, type LightColors, type Rgb } from './colors.ts';
import { type FloorView, paintAxes, paintFloor, paintShadows, project } from './floor.ts';
import { paintStrokes } from './overlay_painter.ts';
import { Rasterizer } from './rasterizer.ts';
import type { LightRobot } from './robot.ts';

const HATCH_CSS_PIXELS = 9;

/**
 * Greys and hatches everything that was drawn by `amount` (0…1), in place, as the 3D view does. Opacity is unchanged.
 *
 * `pixels` are 0xAABBGGRR, transparent where nothing was drawn; `ratio` is pixels per CSS pixel.
 */
export function applyStaleEffect(
  pixels: Uint32Array,
  width: number,
  amount: number,
  { 0: r, 1: g, 2: b }: Rgb,
  ratio: number,
): void {
  const period = Math.max(3, Math.round(HATCH_CSS_PIXELS * ratio));
  const stripe = Float32Array.from({ length: period }, (_, i) => {
    const across = Math.abs(i / period - 0.5) * 2;
    const hatch = Math.min(1, Math.max(0, (across - 0.62) / 0.24));
    return 0.92 - 0.3 * hatch * hatch * (3 - 2 * hatch);
  });
  const keep = 256 - Math.round(amount * 256);
  const part = 256 - keep;
  for (let at = 0, x = 0, y = 0; at < pixels.length; at += 1) {
    const color = pixels[at]!;
    if (color !== 0) {
      const red = color & 255;
      const green = (color >> 8) & 255;
      const blue = (color >> 16) & 255;
      const luma = (red * 54 + green * 183 + blue * 19) >> 8;
      const dim = stripe[(x + y) % period]!;
      const grey = luma * 0.65 * dim;
      const tone = 0.35 * dim;
      const newRed = (red * keep + (grey + r * tone) * part) >> 8;
      const newGreen = (green * keep + (grey + g * tone) * part) >> 8;
      const newBlue = (blue * keep + (grey + b * tone) * part) >> 8;
      pixels[at] = ((color & 0xff000000) | (newBlue << 16) | (newGreen << 8) | newRed) >>> 0;
    }
    x += 1;
    if (x === width) {
      x = 0;
      y += 1;
    }
  }
}

const SHADOW_PART = 4;

/** One robot of a picture. */
export interface PaintedRobot {
  readonly figure: LightRobot | null;
  /** How far it has faded to grey, 0…1. */
  readonly grey: number;
}

/** Everything that one picture shows. */
export interface Picture {
  readonly robots: readonly PaintedRobot[];
  readonly strokes: Strokes;
  readonly tones: LightColors;
  /** Rasterised pixels per CSS pixel, for the meshes. */
  readonly ratio: number;
  /** Draw with smooth edges, regardless of the time it takes. */
  readonly fine: boolean;
}

/** Paints pictures on a canvas, layer by layer: floor, shadows, strokes on the floor, meshes, strokes over the robot. */
export class LightPainter {
  readonly canvas = document.createElement('canvas');
  readonly #camera: CameraRig;
  readonly #context: CanvasRenderingContext2D;
  readonly #floor = document.createElement('canvas');
  readonly #shadows = document.createElement('canvas');
  readonly #shells = document.createElement('canvas');
  readonly #raster = new Rasterizer();
  readonly #glass = new Rasterizer();
  readonly #aside = new Rasterizer();
  /** Key of the view that the cached floor was painted for. */
  #floorFor = '';
  #width = 0;
  #height = 0;

  /** Throws an Error with a message for people when the browser has no 2D canvas. */
  constructor(eye: CameraRig) {
    this.#camera = eye;
    const context = this.canvas.getContext('2d', { alpha: false });
    if (context === null)
      throw new Error('This browser can’t draw on a canvas. The table shows all readings.');
    this.#context = context;
    this.canvas.setAttribute('role', 'img');
    this.canvas.setAttribute('aria-label', 'View of the robot');
    this.canvas.style.cssText = 'display: block; width: 100%; height: 100%; touch-action: none';
  }

  /** Rasterised pixels per CSS pixel of the newest picture's meshes. */
  get pixelRatio(): number {
    return this.#raster.width / Math.max(1, this.#width);
  }

  /** Sets the picture's size, CSS px. */
  resize(width: number, height: number): void {
    this.#width = width;
    this.#height = height;
    const ratio = Math.min(2, Math.max(1, window.devicePixelRatio));
    this.canvas.width = this.#floor.width = Math.round(width * ratio);
    this.canvas.height = this.#floor.height = Math.round(height * ratio);
    this.#floorFor = '';
  }

  /** Draws a picture; returns how many triangles were on the screen. */
  paint(picture: Picture): number {
    const { robots, strokes, tones } = picture;
    const context = this.#context;
    const { width, height } = this.canvas;
    const view = this.#floorView(width, height);
    context.setTransform(1, 0, 0, 1, 0, 0);
    this.#paintFloor(view, tones);
    const figures = robots.flatMap(({ figure }) => figure ?? []);
    if (figures.length === 0) return 0;
    const ratio = width / this.#width;
    this.#paintShadows(figures, tones);
    paintStrokes(context, view, ratio, strokes, false);
    paintAxes(context, view);
    const triangles = this.#paintShells(picture);
    for (const figure of figures) if (!figure.dressed) this.#paintBones(figure, view, tones);
    paintStrokes(context, view, ratio, strokes, true);
    return triangles;
  }

  /** A function that projects points of the world into the next picture, CSS px; null behind the camera. */
  get place(): LabelPlace {
    const view = this.#floorView(this.#width, this.#height);
    return (at) => {
      const point = project(view, ...at);
      return point === null ? null : { x: point[0], y: point[1] };
    };
  }

  /** The link under a point of the canvas, CSS px, or null. */
  pick(robot: LightRobot, x: number, y: number): string | null {
    return robot.pick(x, y, this.#floorView(this.#width, this.#height).screenFromWorld);
  }

  #floorView(width: number, height: number): FloorView {
    const screenFromWorld = this.#camera.screenFromWorld();
    for (let i = 0; i < 4; i += 1) {
      screenFromWorld[i]! *= width / this.#width;
      screenFromWorld[4 + i]! *= height / this.#height;
    }
    const { x, y, flies } = this.#camera.middle;
    const { reach } = this.#camera;
    return { screenFromWorld, width, height, reach, fade: fadeOf(reach, flies), x, y };
  }

  #paintFloor(view: FloorView, tones: LightColors): void {
    const seen = [...view.screenFromWorld].map((value) => value.toPrecision(7)).join(' ');
    const wanted = `${seen} ${view.width} ${view.height} ${tones.page.join()}`;
    const floor = this.#floor.getContext('2d', { alpha: false });
    if (floor === null) return;
    if (wanted !== this.#floorFor) {
      paintFloor(floor, view, tones);
      this.#floorFor = wanted;
    }
    this.#context.drawImage(this.#floor, 0, 0);
  }

  /** Paints shadows at a quarter of the pixels along each side, which is invisible because shadows are soft. */
  #paintShadows(figures: readonly LightRobot[], tones: LightColors): void {
    const { width, height } = this.canvas;
    const [w, h] = [Math.ceil(width / SHADOW_PART), Math.ceil(height / SHADOW_PART)];
    sizeTo(this.#shadows, w, h);
    const shadows = this.#shadows.getContext('2d');
    if (shadows === null) return;
    shadows.clearRect(0, 0, w, h);
    const view = this.#floorView(w, h);
    for (const { boxOfLink, worldFromLink } of figures)
      paintShadows(shadows, view, boxOfLink, worldFromLink, tones);
    this.#context.drawImage(this.#shadows, 0, 0, width, height);
  }

  /** Paints all robots' meshes, farthest first. If one of several robots is grey, it is drawn in its own raster and blended
   *  in. */
  #paintShells({ robots, tones, ratio, fine }: Picture): number {
    const width = Math.max(1, Math.round(this.#width * ratio));
    const height = Math.max(1, Math.round(this.#height * ratio));
    const { screenFromWorld } = this.#floorView(width, height);
    this.#raster.resize(width, height);
    this.#raster.clear();
    let triangles = 0;
    for (const { figure, grey } of this.#farthestFirst(robots)) {
      const alone = grey === 0 || robots.length === 1;
      const raster = alone ? this.#raster : this.#aside;
      if (!alone) raster.clearBefore(this.#raster);
      triangles += figure.draw(raster, screenFromWorld);
      if (figure.hasGhost) {
        this.#glass.clearBefore(raster);
        triangles += figure.drawGhost(this.#glass, screenFromWorld, this.#camera.position);
        raster.overlay(this.#glass);
      }
      if (grey > 0) applyStaleEffect(raster.pixels, width, grey, tones.stale, ratio);
      if (!alone) this.#raster.overlay(raster);
    }
    sizeTo(this.#shells, width, height);
    const shells = this.#shells.getContext('2d');
    shells?.putImageData(new ImageData(this.#raster.bytes, width, height), 0, 0);
    this.#context.imageSmoothingQuality = fine ? 'high' : 'low';
    this.#context.drawImage(this.#shells, 0, 0, this.canvas.width, this.canvas.height);
    return triangles;
  }

  #farthestFirst(robots: readonly PaintedRobot[]): { figure: LightRobot; grey: number }[] {
    const [ex, ey] = this.#camera.position;
    const away = ({ spot: { x, y } }: LightRobot) => Math.hypot(x - ex, y - ey);
    return robots
      .flatMap(({ figure, grey }) => (figure?.dressed === true ? [{ figure, grey }] : []))
      .sort((a, b) => away(b.figure) - away(a.figure));
  }

  /** Paints lines from link to link until the meshes have loaded. */
  #paintBones(robot: LightRobot, view: FloorView, tones: LightColors): void {
    const context = this.#context;
    const at = (link: number) => {
      const [x, y, z] = robot.worldFromLink.subarray(link * 16 + 12, link * 16 + 15);
      return project(view, x!, y!, z!);
    };
    context.strokeStyle = css(tones.muted);
    context.lineWidth = (2 * view.width) / this.#width;
    context.lineCap = 'round';
    context.beginPath();
    for (const [joint, { parent }] of robot.manifest.joints.entries()) {
      const [from, to] = [at(parent), at(joint + 1)];
      if (from === null || to === null) continue;
      context.moveTo(...from);
      context.lineTo(...to);
    }
    context.stroke();
  }
}

function sizeTo(canvas: HTMLCanvasElement, width: number, height: number): void {
  if (canvas.width === width && canvas.height === height) return;
  canvas.width = width;
  canvas.height = height;
}
