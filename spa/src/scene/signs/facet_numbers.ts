import type { DrawnNumbers } from './picture_numbers.ts';

/** Filled triangles as numbers, for renderers: corners in the world (metres), colour, and whether they show through the robot.
 *  Facets are visible from the front only. They are drawn in order, each over the previous ones, and under all strokes. */
export interface FacetNumbers extends DrawnNumbers {
  readonly at: FacetLayout;
}

/** Offset of each attribute of a facet among its numbers. Stored with the facets, because the code that draws them loads before
 *  the code that makes them, and the two share no code. */
export interface FacetLayout {
  /** Its corners, world, metres; counter-clockwise as seen by the viewer. */
  readonly first: number;
  readonly second: number;
  readonly third: number;
  /** Red, green, blue (sRGB) and opacity, 0…1. */
  readonly tint: number;
  /** Whether it shows through the robot (0 or 1). */
  readonly through: number;
}
