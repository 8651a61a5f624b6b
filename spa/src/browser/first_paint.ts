/** What a viewer has seen so far, on the browser's own time line: for measurements. */
type PaintMark = 'posecast:skeleton' | 'posecast:skin';

/** A robot may have no body, or none yet. */
const LONGEST_MS = 2000;

let painted = () => {};
/** On a slow line the first bytes belong to the body. What can wait for the first sight of it, waits for this. */
export const firstPaint = new Promise<void>((done) => {
  painted = done;
});
setTimeout(painted, LONGEST_MS);

export function markOnce(mark: PaintMark): void {
  if (performance.getEntriesByName(mark).length > 0) return;
  performance.mark(mark);
  painted();
}
