import type { FacetNumbers } from '../overlays/facet_numbers.ts';
import type { FloorView } from './floor.ts';

/** A corner closer than this (in radii of the robot) can't be projected. */
const NEAR = 0.05;

/**
 * Paints the overlay's facets on a 2D canvas, in order. `over` true: facets that show through the robot, painted after it; false:
 * the others, painted before it. Adjacent facets of one colour share a path, so that no seam shows.
 */
export function paintFacets(
  context: CanvasRenderingContext2D,
  { screenFromWorld: m, reach }: FloorView,
  facets: FacetNumbers,
  over: boolean,
): void {
  const { numbers, count, stride, at: of } = facets;
  let painted = -1; // index of the facet whose colour is current
  for (let at = 0; at < count * stride; at += stride) {
    if (numbers[at + of.through]! > 0.5 !== over) continue;
    for (let corner = 0; corner < 3; corner += 1) {
      const [x, y, z] = [
        numbers[at + 3 * corner]!,
        numbers[at + 3 * corner + 1]!,
        numbers[at + 3 * corner + 2]!,
      ];
      const w = m[8]! * x + m[9]! * y + m[10]! * z + m[11]!;
      SEEN[2 * corner] = w < reach * NEAR ? Number.NaN : (m[0]! * x + m[1]! * y + m[2]! * z + m[3]!) / w;
      SEEN[2 * corner + 1] = (m[4]! * x + m[5]! * y + m[6]! * z + m[7]!) / w;
    }
    const [ax, ay, bx, by, cx, cy] = SEEN as unknown as Six;
    if (!((bx - ax) * (cy - ay) - (cx - ax) * (by - ay) < 0)) continue; // back face: the canvas' y axis points down
    if (painted < 0 || !sameTint(numbers, at + of.tint, painted + of.tint)) {
      if (painted >= 0) context.fill();
      context.fillStyle = tintAt(numbers, at + of.tint);
      context.beginPath();
    }
    painted = at;
    context.moveTo(ax, ay);
    context.lineTo(bx, by);
    context.lineTo(cx, cy);
  }
  if (painted >= 0) context.fill();
}

type Six = readonly [number, number, number, number, number, number];
const SEEN = new Float64Array(6);

function sameTint(numbers: Float32Array, one: number, other: number): boolean {
  for (let i = 0; i < 4; i += 1) {
    if (numbers[one + i] !== numbers[other + i]) return false;
  }
  return true;
}

function tintAt(numbers: Float32Array, at: number): string {
  const part = (i: number) => Math.round(numbers[at + i]! * 255);
  return `rgb(${part(0)} ${part(1)} ${part(2)} / ${numbers[at + 3]!.toFixed(3)})`;
}
