import { addScaled, dot, rotateAbout } from '../../model/vectors.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { AT, STRIDE, type Strokes } from '../signs/strokes.ts';
import type { FloorView } from './floor.ts';

/** Segments of a full turn. */
const STEPS = 48;
/** Minimum width of a stroke, CSS px. */
const LEAST_PX = 1.2;

interface Stroke {
  readonly spot: Vec3;
  readonly start: Vec3;
  readonly axis: Vec3;
  /** rad; 0 is straight. */
  readonly sweep: number;
  /** Metres: length, or radius of the arc; then the tube's radius at either end. */
  readonly size: number;
  readonly radius: number;
  readonly endRadius: number;
  readonly flat: boolean;
  readonly color: string;
}

/** A point of the world, projected to the picture. */
interface Seen {
  readonly x: number;
  readonly y: number;
  /** Pixels per metre at its distance. */
  readonly scale: number;
}

/**
 * Paints the overlay's strokes on a 2D canvas as filled paths, farthest first. `over` true: strokes that show through the robot,
 * painted after it; false: the others, painted before it.
 */
export function paintStrokes(
  context: CanvasRenderingContext2D,
  sight: FloorView,
  pixelRatio: number,
  strokes: Strokes,
  over: boolean,
): void {
  const look = lookOf(sight);
  const order: { stroke: Stroke; away: number }[] = [];
  for (let i = 0; i < strokes.count; i += 1) {
    const at = i * STRIDE;
    if (strokes.numbers[at + AT.manner + 1]! > 0.5 !== over) continue;
    const stroke = strokeAt(strokes.numbers, at);
    const middle = stroke.sweep === 0 ? addScaled(stroke.spot, stroke.axis, stroke.size / 2) : stroke.spot;
    order.push({ stroke, away: look.away(middle) });
  }
  order.sort((a, b) => b.away - a.away);
  context.lineCap = 'butt';
  context.lineJoin = 'round';
  for (const { stroke } of order) {
    context.fillStyle = context.strokeStyle = stroke.color;
    if (stroke.sweep === 0) paintShaft(context, look, stroke, LEAST_PX * pixelRatio);
    else if (stroke.flat) paintFan(context, look, stroke);
    else paintArc(context, look, stroke, LEAST_PX * pixelRatio);
  }
}

interface Look {
  /** Projects a point; null behind the camera. */
  at(point: Vec3): Seen | null;
  /** Depth of a point along the camera's direction, metres. */
  away(point: Vec3): number;
  readonly ahead: Vec3;
}

function lookOf({ screenFromWorld, reach }: FloorView): Look {
  const row = (i: number): Vec3 => [screenFromWorld[i]!, screenFromWorld[i + 1]!, screenFromWorld[i + 2]!];
  const ahead = row(8);
  const right = row(0);
  const focal = Math.hypot(...addScaled(right, ahead, -dot(right, ahead)));
  const away = (point: Vec3) => dot(ahead, point) + screenFromWorld[11]!;
  return {
    ahead,
    away,
    at: (point) => {
      const w = away(point);
      if (w < reach * 0.05) return null;
      const x = (dot(right, point) + screenFromWorld[3]!) / w;
      const y = (dot(row(4), point) + screenFromWorld[7]!) / w;
      return { x, y, scale: focal / w };
    },
  };
}

function strokeAt(numbers: Float32Array, at: number): Stroke {
  const triple = (i: number): Vec3 => [numbers[at + i]!, numbers[at + i + 1]!, numbers[at + i + 2]!];
  const part = (i: number) => numbers[at + i]!;
  const [r, g, b] = triple(AT.tint).map((value) => Math.round(value * 255));
  return {
    spot: triple(AT.spot),
    start: triple(AT.start),
    axis: triple(AT.axis),
    sweep: part(AT.shape),
    size: part(AT.shape + 1),
    radius: part(AT.shape + 2),
    endRadius: part(AT.shape + 3),
    flat: part(AT.manner) < 1,
    color: `rgb(${r} ${g} ${b} / ${part(AT.tint + 3)})`,
  };
}

/** Paints a tube or a cone: a quadrilateral between its ends, and the two end discs. */
function paintShaft(context: CanvasRenderingContext2D, look: Look, stroke: Stroke, leastPx: number): void {
  const { spot, axis, size, radius, endRadius } = stroke;
  const from = look.at(spot);
  const to = look.at(addScaled(spot, axis, size));
  if (from === null || to === null) return;
  const head = endRadius === 0;
  const ra = Math.max(radius * from.scale, head ? 0 : leastPx / 2);
  const rb = head ? 0 : Math.max(endRadius * to.scale, leastPx / 2);
  const [dx, dy] = [to.x - from.x, to.y - from.y];
  const length = Math.hypot(dx, dy);
  const [nx, ny] = length > 0 ? [-dy / length, dx / length] : [0, 1];
  const turned = Math.atan2(ny, nx);
  /** How round a disc across the axis appears: 0 seen from its edge, 1 from the front. */
  const open = Math.abs(dot(axis, look.ahead));
  context.beginPath();
  context.moveTo(from.x + nx * ra, from.y + ny * ra);
  context.lineTo(to.x + nx * rb, to.y + ny * rb);
  context.lineTo(to.x - nx * rb, to.y - ny * rb);
  context.lineTo(from.x - nx * ra, from.y - ny * ra);
  context.fill();
  if (!opaque(stroke)) return;
  paintDisc(context, from, ra, turned, open);
  paintDisc(context, to, rb, turned, open);
}

/** Transparent strokes get no end discs: overlaps would show, and the strokes are too thin for round ends anyway. */
function opaque({ color }: Stroke): boolean {
  return color.endsWith('/ 1)');
}

function paintDisc(
  context: CanvasRenderingContext2D,
  { x, y }: Seen,
  radius: number,
  turned: number,
  open: number,
): void {
  if (radius <= 0) return;
  context.beginPath();
  context.ellipse(x, y, radius, radius * open, turned, 0, 2 * Math.PI);
  context.fill();
}

function paintArc(context: CanvasRenderingContext2D, look: Look, stroke: Stroke, leastPx: number): void {
  const centre = look.at(stroke.spot);
  if (centre === null) return;
  context.lineWidth = Math.max(leastPx, 2 * stroke.radius * centre.scale);
  context.beginPath();
  follow(context, look, round(stroke, stroke.size));
  if (stroke.sweep >= 2 * Math.PI - 1e-4) context.closePath();
  context.stroke();
}

function paintFan(context: CanvasRenderingContext2D, look: Look, stroke: Stroke): void {
  const inner = stroke.size - stroke.radius;
  const back = inner > 1e-6 ? round(stroke, inner).reverse() : [stroke.spot];
  context.beginPath();
  follow(context, look, [...round(stroke, stroke.size + stroke.radius), ...back]);
  context.closePath();
  context.fill();
}

/** Points along the stroke's arc at this radius, world. */
function round({ spot, start, axis, sweep }: Stroke, radius: number): Vec3[] {
  const steps = Math.max(2, Math.ceil((sweep / (2 * Math.PI)) * STEPS));
  return Array.from({ length: steps + 1 }, (_, i) =>
    addScaled(spot, rotateAbout(axis, (sweep * i) / steps, start), radius),
  );
}

function follow(context: CanvasRenderingContext2D, look: Look, points: readonly Vec3[]): void {
  let begun = false;
  for (const point of points) {
    const at = look.at(point);
    if (at === null) continue;
    if (begun) context.lineTo(at.x, at.y);
    else context.moveTo(at.x, at.y);
    begun = true;
  }
}
