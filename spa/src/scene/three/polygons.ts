import { ShapeUtils, Vector2 } from 'three';
import type { MeshNote } from '../../model/report.ts';

/**
 * Divides polygons of any shape into triangles, like the edge (posecast_edge.model.meshes.mesh.PolygonCutter): convex ones become
 * fans, others are cut by ears.
 */

/** Corners of a polygon that is cut: cutting takes up to their square. */
const MAX_CORNERS = 10_000;
/** The sum of those squares, of one mesh. */
const MAX_WORK = 2e9;
const BEYOND: MeshNote = ['polygon', 'polygons with too many corners; their notches and holes are filled'];
/** Sine of an angle: corners that turn back by less count as straight. */
const STRAIGHT = 1e-6;

type Point = readonly [number, number, number];

/** Cuts the polygons of one mesh. */
export class PolygonCutter {
  readonly #notes: MeshNote[];
  #work = 0;

  constructor(notes: MeshNote[]) {
    this.#notes = notes;
  }

  /** The triangles of a polygon with a corner at each point, as three numbers of corners each. */
  cut(points: readonly Point[]): readonly number[] {
    if (points.length < 4) return points.length === 3 ? [0, 1, 2] : [];
    const back = reflexCorners(points);
    if (points.length === 4) return back[1] || back[3] ? [1, 2, 3, 1, 3, 0] : [0, 1, 2, 0, 2, 3];
    return (back.includes(true) ? this.cutRings([points]) : null) ?? fan(points.length);
  }

  /** Cuts an outline and its holes into triangles of corner numbers through all rings. Null if they have too many corners or no
   *  area. */
  cutRings(rings: readonly (readonly Point[])[]): readonly number[] | null {
    const outline = rings[0]!;
    const count = rings.reduce((sum, ring) => sum + ring.length, 0);
    this.#work += count ** 2;
    if (count > MAX_CORNERS || this.#work > MAX_WORK) {
      if (!this.#notes.includes(BEYOND)) this.#notes.push(BEYOND);
      return null;
    }
    const normal = normalOf(outline);
    const largest = Math.max(...normal.map(Math.abs));
    if (outline.length < 3 || !(largest > 0 && Number.isFinite(largest))) return null;
    const drop = normal.findIndex((part) => Math.abs(part) === largest);
    const [first, second] = [(drop + 1) % 3, (drop + 2) % 3];
    const [u, v] = normal[drop]! > 0 ? [first, second] : [second, first];
    const numbers = new Map<Vector2, number>();
    const [flat = [], ...holes] = rings.map((ring) =>
      ring.map((point) => {
        const corner = new Vector2(point[u]! - outline[0]![u]!, point[v]! - outline[0]![v]!);
        numbers.set(corner, numbers.size);
        return corner;
      }),
    );
    const faces = ShapeUtils.triangulateShape(flat, holes); // drops a last corner that repeats the first
    const corners = [flat, ...holes].flat();
    const cut = faces.map((face) => face.map((corner) => corners[corner]!));
    const doubled = cut.reduce(
      (sum, [a, b, c]) => sum + (b!.x - a!.x) * (c!.y - a!.y) - (b!.y - a!.y) * (c!.x - a!.x),
      0,
    );
    return cut.flatMap((face) => (doubled < 0 ? face.reverse() : face).map((corner) => numbers.get(corner)!));
  }
}

/** The triangles of a convex polygon, as numbers of corners. */
export function fan(corners: number): number[] {
  return Array.from({ length: Math.max(corners - 2, 0) }, (_, i) => [0, i + 1, i + 2]).flat();
}

function minus(a: Point, b: Point): Point {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

function cross(a: Point, b: Point): Point {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** Newell's normal, with a length of twice the area. */
function normalOf(points: readonly Point[]): Point {
  let [x, y, z] = [0, 0, 0];
  for (const [i, point] of points.entries()) {
    const part = cross(minus(point, points[0]!), minus(points[(i + 1) % points.length]!, points[0]!));
    [x, y, z] = [x + part[0], y + part[1], z + part[2]];
  }
  return [x, y, z];
}

/** Of each corner, whether it turns back, or may: one at the same place as the next. */
function reflexCorners(points: readonly Point[]): boolean[] {
  const normal = normalOf(points);
  const length = Math.hypot(...normal);
  return points.map((point, i) => {
    const come = minus(point, points.at(i - 1)!);
    const go = minus(points[(i + 1) % points.length]!, point);
    const turn = cross(come, go);
    const along = turn[0] * normal[0] + turn[1] * normal[1] + turn[2] * normal[2];
    const lengths = Math.hypot(...come) * Math.hypot(...go) * length;
    return along < -STRAIGHT * lengths || lengths === 0;
  });
}
