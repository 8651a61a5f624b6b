import { normalize, rejectFrom, scale } from '../../model/vectors.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { type Paint, PictureNumbers, tintOf } from './picture_numbers.ts';

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
