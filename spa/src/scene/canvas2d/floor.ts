import type { LinkBox } from '../../model/bounds.ts';
import { css, type LightColors, type Rgb } from './colors.ts';
import { KEY } from './lighting.ts';

/** Distances at which the minor and major lines (in lengths of fading) and the lit floor (in radii of the robot) have
 *  faded out. */
const MINOR_REACHES = 3.2;
const MAJOR_REACHES = 9;
const POOL_REACHES = 7;
/** When the fading length exceeds this (under a flying robot), only every tenth line is drawn; metres. */
const WIDE_FADE = 4;
/** Grid lines are drawn in pieces, each with one of a few opacities. */
const PIECES = 10;
const FAINTNESSES = 6;
/** Only this many links, the largest, cast shadows: more would cost time without a visible difference. */
const MOST_SHADOWS = 24;
/** x red, y green, z blue, as muted as in the 3D view. */
const AXES: readonly Rgb[] = [
  [0xb3, 0x68, 0x6e],
  [0x58, 0x98, 0x7b],
  [0x5e, 0x85, 0xc3],
];

/** How the floor is viewed: `CameraRig.screenFromWorld` scaled to the canvas, the canvas size in pixels, and the robot's radius
 *  `reach` in metres. */
export interface FloorView {
  readonly screenFromWorld: Float64Array;
  readonly width: number;
  readonly height: number;
  readonly reach: number;
  /** The length by which lines fade (`fadeOf`), metres. */
  readonly fade: number;
  /** The middle of the lit floor, metres. */
  readonly x: number;
  readonly y: number;
}

/** Paints the floor: a lit disc that fades to the page's colour, and a grid of 1 m and 0.1 m. */
export function paintFloor(context: CanvasRenderingContext2D, view: FloorView, tones: LightColors): void {
  const { width, height, reach, fade } = view;
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.fillStyle = css(tones.page);
  context.fillRect(0, 0, width, height);
  const disc = discOnScreen(view, view.x, view.y, reach * POOL_REACHES, 0, 0, reach * POOL_REACHES);
  if (disc !== null) {
    const pool = context.createRadialGradient(0, 0, 0, 0, 0, 1);
    for (let i = 0; i <= 8; i += 1) {
      const s = 1 - smooth(i / 8);
      pool.addColorStop(i / 8, css(tones.floor, s * s));
    }
    context.setTransform(...disc);
    context.fillStyle = pool;
    context.beginPath();
    context.arc(0, 0, 1, 0, 2 * Math.PI);
    context.fill();
    context.setTransform(1, 0, 0, 1, 0, 0);
  }
  const pitch = fade > reach + WIDE_FADE ? 10 : 1;
  lines(context, view, 0.1 * pitch, MINOR_REACHES, 0.5, tones.minorLine);
  lines(context, view, pitch, MAJOR_REACHES, 1, tones.majorLine);
}

/** The small axes at the robot's base: x red, y green, z blue. */
export function paintAxes(context: CanvasRenderingContext2D, view: FloorView): void {
  const from = project(view, view.x, view.y, 0);
  if (from === null) return;
  context.lineWidth = Math.max(1.5, (view.reach * 0.01 * view.height) / 2);
  context.lineWidth = Math.min(4, context.lineWidth);
  context.lineCap = 'round';
  const length = view.reach * 0.28;
  for (const [axis, color] of AXES.entries()) {
    const end = project(
      view,
      view.x + (axis === 0 ? length : 0),
      view.y + (axis === 1 ? length : 0),
      axis === 2 ? length : 0,
    );
    if (end === null) continue;
    context.strokeStyle = css(color);
    context.beginPath();
    context.moveTo(...from);
    context.lineTo(...end);
    context.stroke();
  }
}

/** Paints soft shadows that the key lamp casts of the links' boxes; the higher a link, the softer its shadow. */
export function paintShadows(
  context: CanvasRenderingContext2D,
  view: FloorView,
  boxes: ReadonlyMap<number, LinkBox>,
  worldFromLink: Float64Array,
  tones: LightColors,
): void {
  const sized = [...boxes].map(([link, box]) => ({
    link,
    box,
    size: Math.hypot(...box.max.map((m, i) => m - box.min[i]!)),
  }));
  if (sized.length > MOST_SHADOWS) sized.sort((a, b) => b.size - a.size).length = MOST_SHADOWS;
  for (const { link, box, size } of sized) {
    const m = worldFromLink.subarray(link * 16, link * 16 + 16);
    const centre = [0, 1, 2].map((i) => (box.min[i]! + box.max[i]!) / 2);
    const at = [0, 1, 2].map(
      (r) => m[r]! * centre[0]! + m[4 + r]! * centre[1]! + m[8 + r]! * centre[2]! + m[12 + r]!,
    );
    const height = Math.max(0, at[2]!);
    // The shadow as an ellipse: the covariance of the box's half edges, projected along the light onto the floor.
    let xx = 0;
    let xy = 0;
    let yy = 0;
    for (let axis = 0; axis < 3; axis += 1) {
      const half = (box.max[axis]! - box.min[axis]!) / 2;
      const drop = (m[axis * 4 + 2]! * half) / KEY[2];
      const vx = m[axis * 4]! * half - KEY[0] * drop;
      const vy = m[axis * 4 + 1]! * half - KEY[1] * drop;
      xx += vx * vx;
      xy += vx * vy;
      yy += vy * vy;
    }
    const blur = (0.06 * view.reach + 0.22 * height) ** 2;
    xx += blur;
    yy += blur;
    const middle = (xx + yy) / 2;
    const apart = Math.hypot((xx - yy) / 2, xy);
    const angle = 0.5 * Math.atan2(2 * xy, xx - yy);
    const long = Math.sqrt(middle + apart);
    const short = Math.sqrt(Math.max(middle - apart, blur));
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    const throwX = at[0]! - (KEY[0] / KEY[2]) * height;
    const throwY = at[1]! - (KEY[1] / KEY[2]) * height;
    const disc = discOnScreen(
      view,
      throwX,
      throwY,
      c * long * 1.25,
      s * long * 1.25,
      -s * short * 1.25,
      c * short * 1.25,
    );
    if (disc === null) continue;
    const strength = Math.min(0.5, (tones.shadow * 0.75 * (size * size)) / (long * short * 8));
    const soft = context.createRadialGradient(0, 0, 0, 0, 0, 1);
    soft.addColorStop(0, `rgb(0 0 0 / ${strength})`);
    soft.addColorStop(0.5, `rgb(0 0 0 / ${strength * 0.55})`);
    soft.addColorStop(1, 'rgb(0 0 0 / 0)');
    context.setTransform(...disc);
    context.fillStyle = soft;
    context.beginPath();
    context.arc(0, 0, 1, 0, 2 * Math.PI);
    context.fill();
  }
  context.setTransform(1, 0, 0, 1, 0, 0);
}

/** Projects a point of the world (metres) to canvas pixels; null when it is behind the camera or too close. */
export function project(
  { screenFromWorld, reach }: FloorView,
  x: number,
  y: number,
  z: number,
): [number, number] | null {
  const w =
    screenFromWorld[8]! * x + screenFromWorld[9]! * y + screenFromWorld[10]! * z + screenFromWorld[11]!;
  if (w < reach * 0.05) return null;
  return [
    (screenFromWorld[0]! * x + screenFromWorld[1]! * y + screenFromWorld[2]! * z + screenFromWorld[3]!) / w,
    (screenFromWorld[4]! * x + screenFromWorld[5]! * y + screenFromWorld[6]! * z + screenFromWorld[7]!) / w,
  ];
}

/** The canvas transform from the unit disc to an ellipse on the floor around (x, y) with half axes a and b. It is
 *  affine, so exact only near the middle. */
function discOnScreen(
  view: FloorView,
  x: number,
  y: number,
  ax: number,
  ay: number,
  bx: number,
  by: number,
): [number, number, number, number, number, number] | null {
  const at = project(view, x, y, 0);
  // Small steps, because the far ends of the axes may be behind the camera.
  const step = 0.05;
  const a = project(view, x + ax * step, y + ay * step, 0);
  const b = project(view, x + bx * step, y + by * step, 0);
  if (at === null || a === null || b === null) return null;
  return [
    (a[0] - at[0]) / step,
    (a[1] - at[1]) / step,
    (b[0] - at[0]) / step,
    (b[1] - at[1]) / step,
    at[0],
    at[1],
  ];
}

function lines(
  context: CanvasRenderingContext2D,
  view: FloorView,
  pitch: number,
  reaches: number,
  fromReaches: number,
  color: Rgb,
): void {
  const far = reaches * view.fade;
  const count = Math.min(80, Math.ceil(far / pitch));
  const paths = Array.from({ length: FAINTNESSES }, () => new Path2D());
  const used = new Set<number>();
  for (const along of [0, 1]) {
    const middle = Math.round((along === 0 ? view.y : view.x) / pitch);
    for (let line = middle - count; line <= middle + count; line += 1) {
      const across = line * pitch - (along === 0 ? view.y : view.x);
      if (Math.abs(across) >= far) continue;
      const half = Math.sqrt(far * far - across * across);
      for (let piece = 0; piece < PIECES; piece += 1) {
        const from = -half + (2 * half * piece) / PIECES;
        const to = from + (2 * half) / PIECES;
        const away = Math.hypot((from + to) / 2, across) / view.fade;
        const seen = 1 - smooth((away - fromReaches) / (reaches - fromReaches));
        const faintness = Math.min(FAINTNESSES - 1, Math.floor(seen * FAINTNESSES));
        const at = line * pitch;
        const a = along === 0 ? project(view, view.x + from, at, 0) : project(view, at, view.y + from, 0);
        const b = along === 0 ? project(view, view.x + to, at, 0) : project(view, at, view.y + to, 0);
        if (a === null || b === null) continue;
        paths[faintness]!.moveTo(...a);
        paths[faintness]!.lineTo(...b);
        used.add(faintness);
      }
    }
  }
  context.lineWidth = 1;
  for (const faintness of used) {
    context.strokeStyle = css(color, (faintness + 0.5) / FAINTNESSES);
    context.stroke(paths[faintness]!);
  }
}

function smooth(part: number): number {
  const t = Math.min(1, Math.max(0, part));
  return t * t * (3 - 2 * t);
}
