/** A point of the picture, CSS px. */
export interface Spot {
  readonly x: number;
  readonly y: number;
}

/** A line in the picture, CSS px. */
export type Line = readonly [from: Spot, to: Spot];

/** Label on a body → the lines that are drawn for what it names, also of a label that finds no room. What a tap means is
 *  found by them. */
export const drawnLines = new WeakMap<HTMLElement, readonly Line[]>();
