import { normalize, rejectFrom, scale } from '../../model/vectors.ts';
import type { Vec3 } from '../../twin/rotation.ts';

export interface Paint {
  /** sRGB 0xrrggbb */
  readonly color: number;
  /** 0…1; strokes with less than 1 are drawn after all others. */
  readonly opacity?: number;
  /** Whether it shows through the robot, faintly. */
  readonly through?: boolean;
}

/** The data of a picture, for renderers: rows of numbers, each with one row of attributes. */
export interface DrawnNumbers {
  /** The rows of the newest complete picture, `stride` numbers each. Always the same array. */
  readonly numbers: Float32Array;
  /** The number of rows in it. */
  readonly count: number;
  readonly stride: number;
}

/** Rows of numbers that are rebuilt for each picture. */
export class PictureNumbers implements DrawnNumbers {
  readonly stride: number;
  readonly numbers: Float32Array;
  #count = 0;
  readonly #most: number;
  /** The rows of the picture being built, and their number. */
  protected readonly making: Float32Array;
  protected made = 0;

  /** `most`: further rows are not drawn. */
  constructor(most: number, stride: number) {
    this.#most = most;
    this.stride = stride;
    this.numbers = new Float32Array(most * stride);
    this.making = new Float32Array(most * stride);
  }

  get count(): number {
    return this.#count;
  }

  /** Starts a new picture. */
  begin(): void {
    this.made = 0;
  }

  /** Completes the picture. False if it equals the previous one. */
  end(): boolean {
    const length = this.made * this.stride;
    let changed = this.made !== this.#count;
    for (let i = 0; i < length && !changed; i += 1) changed = this.making[i] !== this.numbers[i];
    if (changed) this.numbers.set(this.making.subarray(0, length));
    this.#count = this.made;
    return changed;
  }

  protected get isFull(): boolean {
    return this.made === this.#most;
  }
}

/** A paint's red, green, blue (sRGB) and opacity, 0…1. */
export function tintOf({ color, opacity = 1 }: Paint): readonly number[] {
  return [(color >> 16) / 255, ((color >> 8) & 255) / 255, (color & 255) / 255, opacity];
}

/** Maximum strokes in one picture; further ones are not drawn. 200 deviating joints need 600. */
export const MOST_STROKES = 1024;
/** Thickness of a fan relative to its width. */
const FLAT = 0.004;

/** Offset of each attribute of a stroke among its STRIDE numbers. */
export const AT = {
  spot: 0,
  start: 3,
  axis: 6,
  /** Sweep (rad; 0 is straight), size (length, or radius of the arc), and the tube's radius at either end; metres. */
  shape: 9,
  /** Thickness along the axis relative to that across it, and whether it shows through the robot (0 or 1). */
  manner: 13,
  /** Red, green, blue (sRGB) and opacity, 0…1. */
  tint: 15,
} as const;
export const STRIDE = 19;

/**
 * All strokes of an overlay as numbers, independent of the renderer. Shafts, heads, arcs, rings and fans are all
 * strokes: a round or flat tube along a straight line or an arc, with a radius at either end. World, metres.
 */
export class Strokes extends PictureNumbers {
  #veils: number[][] = [];

  constructor() {
    super(MOST_STROKES, STRIDE);
  }

  override begin(): void {
    super.begin();
    this.#veils = [];
  }

  override end(): boolean {
    for (const veil of this.#veils.splice(0)) this.#put(veil);
    return super.end();
  }

  /** Adds a straight stroke from a point along a unit vector; metres. An arrow head has an end radius of 0. */
  shaft(from: Vec3, along: Vec3, length: number, radius: number, endRadius: number, paint: Paint): void {
    const side = normalize(rejectFrom(Math.abs(along[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], along));
    this.#stroke(from, side, along, [0, length, radius, endRadius], 1, paint);
  }

  /** Adds an arc about a unit axis, starting at a unit vector across it; radians, metres. */
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

  /** Adds a flat sector between two radii about a unit axis, starting at a unit vector across it; radians, metres. */
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
    paint: Paint,
  ): void {
    const tint = tintOf(paint);
    const stroke = [...spot, ...start, ...axis, ...shape, flatness, paint.through ? 1 : 0, ...tint];
    if (tint[3]! < 1) this.#veils.push(stroke);
    else this.#put(stroke);
  }

  #put(stroke: readonly number[]): void {
    if (this.isFull) return;
    this.making.set(stroke, this.made * STRIDE);
    this.made += 1;
  }
}

/** Flips the axis for a negative sweep, since a stroke's sweep is positive. */
function rightWay(axis: Vec3, sweep: number): Vec3 {
  return sweep < 0 ? scale(axis, -1) : axis;
}

/** Maximum facets in one picture; further ones are not drawn. The balance of one robot takes about 1,000. */
export const MOST_FACETS = 8192;

/** Offset of each attribute of a facet among its FACET_STRIDE numbers: its corners, then its paint as in `AT`. */
export const FACET_AT = { first: 0, second: 3, third: 6, tint: 9, through: 13 } as const;
export const FACET_STRIDE = 14;

/**
 * Filled triangles of an overlay as numbers, independent of the renderer: the counterpart of `Strokes` for areas. World, metres.
 * They are visible from the front only, and drawn in order, each over the previous ones, under all strokes.
 */
export class Facets extends PictureNumbers {
  constructor() {
    super(MOST_FACETS, FACET_STRIDE);
  }

  /** Adds a triangle, its corners counter-clockwise as seen by the viewer. */
  add(a: Vec3, b: Vec3, c: Vec3, paint: Paint): void {
    if (this.isFull) return;
    this.making.set([...a, ...b, ...c], this.made * FACET_STRIDE + FACET_AT.first);
    this.#paint(paint);
  }

  /** Adds a shape of many triangles, nine numbers each: rotated about the vertical (rad), scaled and moved to a point. */
  addShape(corners: ArrayLike<number>, [x, y, z]: Vec3, size: number, heading: number, paint: Paint): void {
    const [c, s] = [size * Math.cos(heading), size * Math.sin(heading)];
    const to = this.making;
    for (let from = 0; from < corners.length && !this.isFull; from += 9) {
      const at = this.made * FACET_STRIDE + FACET_AT.first;
      for (let i = 0; i < 9; i += 3) {
        const [px, py] = [corners[from + i]!, corners[from + i + 1]!];
        to[at + i] = x + c * px - s * py;
        to[at + i + 1] = y + s * px + c * py;
        to[at + i + 2] = z + size * corners[from + i + 2]!;
      }
      this.#paint(paint);
    }
  }

  /** Completes the facet whose corners have been written. */
  #paint(paint: Paint): void {
    this.making.set([...tintOf(paint), paint.through ? 1 : 0], this.made * FACET_STRIDE + FACET_AT.tint);
    this.made += 1;
  }
}
