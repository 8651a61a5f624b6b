import type { Mark } from '../../../past/past_types.ts';
import { pxAt, type View } from './track_view.ts';

/** The maximum distance of a tap from a mark, CSS px. */
const NEAR_PX = 10;
/** A tap on a mark starts this long before it, to show what led up to it, ms. */
export const BEFORE_MS = 2000;

/** The mark hit by a tap: the nearest fault, else the nearest caution; null if none is near. */
export function markNear(marks: readonly Mark[], view: View, xPx: number): Mark | null {
  const near = marksNear(marks, view, xPx);
  return near.find(({ level }) => level === 'fault') ?? near[0] ?? null;
}

export function marksNear(marks: readonly Mark[], view: View, xPx: number): Mark[] {
  const far = ({ atMs }: Mark) => Math.abs(pxAt(view, atMs) - xPx);
  return marks.filter((mark) => far(mark) <= NEAR_PX).sort((a, b) => far(a) - far(b));
}
