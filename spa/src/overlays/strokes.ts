import { normalize, rejectFrom, scale } from '../model/vectors.ts';
import type { Vec3 } from '../twin/rotation.ts';

/** Strokes in one picture; what is beyond that is not drawn. 200 joints that all deviate need 600. */
export const MOST_STROKES = 1024;
/** Of a fan: its thickness for each unit of its width. */
const FLAT = 0.004;

/** Where each number of a stroke stands among its STRIDE. */
export const AT = {
  spot: 0,
  start: 3,
  axis: 6,
  /** Sweep (rad; 0 is straight), size (length, or radius of the arc), and the radius at either end; metres. */
  shape: 9,
  /** Thickness along the axis for each unit across it, and whether it shows through the robot (0 or 1). */
  manner: 13,
  /** Red, green, blue as a screen shows them and opacity, 0…1. */
  tint: 15,
} as const;
export const STRIDE = 19;

export interface Paint {
  /** sRGB 0xrrggbb */
  readonly color: number;
  /** 0…1; below 1 strokes are drawn after all others. */
  readonly opacity?: number;
  /** Whether it shows through the robot, faintly. */
  readonly through?: boolean;
}

/**
 * All signs of a picture as numbers, for whoever draws them: shafts, heads, arcs, rings and fans are one kind of body,
 * a stroke: a tube along a straight or round line, with a radius at either end, round or flat. World, metres.
 */
export class Strokes {
  /** Those of the newest whole picture, STRIDE numbers each; the same array always. */
  readonly numbers = new Float32Array(MOST_STROKES * STRIDE);
  #count = 0;
  readonly #making = new Float32Array(MOST_STROKES * STRIDE);
  #made = 0;
  #veils: number[][] = [];

  /** Strokes of the newest whole picture. */
  get count(): number {
    return this.#count;
  }

  /** Starts a new picture. */
  begin(): void {
    this.#made = 0;
    this.#veils = [];
  }

  /** Ends it. False when it is the picture before: then there is nothing to draw. */
  end(): boolean {
    for (const veil of this.#veils.splice(0)) this.#put(veil);
    const length = this.#made * STRIDE;
    let changed = this.#made !== this.#count;
    for (let i = 0; i < length && !changed; i += 1) changed = this.#making[i] !== this.numbers[i];
    if (changed) this.numbers.set(this.#making.subarray(0, length));
    this.#count = this.#made;
    return changed;
  }

  /** A straight stroke from a place along a unit vector; metres. A head is one that ends in nothing. */
  shaft(from: Vec3, along: Vec3, length: number, radius: number, endRadius: number, paint: Paint): void {
    const side = normalize(rejectFrom(Math.abs(along[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], along));
    this.#stroke(from, side, along, [0, length, radius, endRadius], 1, paint);
  }

  /** A round stroke about a unit axis, from a unit vector across it; radians, metres. */
  arc(
    centre: Vec3,
    axis: Vec3,
    start: Vec3,
    sweep: number,
    radius: number,
    thickness: number,
    paint: Paint,
  ): void {
    const shape = [Math.abs(sweep), radius, thickness, thickness] as const;
    this.#stroke(centre, start, rightWay(axis, sweep), shape, 1, paint);
  }

  /** A flat slice between two radii, about a unit axis from a unit vector across it. */
  fan(
    centre: Vec3,
    axis: Vec3,
    start: Vec3,
    sweep: number,
    inner: number,
    outer: number,
    paint: Paint,
  ): void {
    const half = (outer - inner) / 2;
    const shape = [Math.abs(sweep), inner + half, half, half] as const;
    this.#stroke(centre, start, rightWay(axis, sweep), shape, FLAT, paint);
  }

  #stroke(
    spot: Vec3,
    start: Vec3,
    axis: Vec3,
    shape: readonly [number, number, number, number],
    flatness: number,
    { color, opacity = 1, through = false }: Paint,
  ): void {
    const rgb = [color >> 16, (color >> 8) & 255, color & 255].map((part) => part / 255);
    const stroke = [...spot, ...start, ...axis, ...shape, flatness, through ? 1 : 0, ...rgb, opacity];
    if (opacity < 1) this.#veils.push(stroke);
    else this.#put(stroke);
  }

  #put(stroke: readonly number[]): void {
    if (this.#made === MOST_STROKES) return;
    this.#making.set(stroke, this.#made * STRIDE);
    this.#made += 1;
  }
}

/** A turn the other way round is a turn about the other end of the axis; a stroke's sweep is positive. */
function rightWay(axis: Vec3, sweep: number): Vec3 {
  return sweep < 0 ? scale(axis, -1) : axis;
}
