import type { DrawnNumbers } from './picture_numbers.ts';

/** Filled triangles as numbers, for renderers: corners in the world (metres), colour, and whether they show through the
 *  robot. A facet is seen from its front alone. Facets are drawn in their order, each over those before it, under all
 *  strokes. */
export interface FacetNumbers extends DrawnNumbers {
  readonly at: FacetLayout;
}

/** Offset of each attribute of a facet among its numbers. Told with the facets: what draws them comes before what makes
 *  them, and shares no code with it. */
export interface FacetLayout {
  /** Its corners, world, metres; counter-clockwise for who sees it. */
  readonly first: number;
  readonly second: number;
  readonly third: number;
  /** Red, green, blue (sRGB) and opacity, 0…1. */
  readonly tint: number;
  /** Whether it shows through the robot (0 or 1). */
  readonly through: number;
}
