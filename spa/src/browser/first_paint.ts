/** Marks on the browser's performance time line: when the robot was first seen as lines, and in its shells. */
type PaintMark = 'posecast:skeleton' | 'posecast:skin';

/** `firstPaint` waits no longer than this: a robot may have no body, or none yet. */
const LONGEST_MS = 2000;

let painted = () => {};
/** Resolves when the robot was first drawn. On a slow line the first bytes belong to the body: what can wait, waits for this. */
export const firstPaint = new Promise<void>((done) => {
  painted = done;
});
setTimeout(painted, LONGEST_MS);

/** Sets a mark, and resolves `firstPaint`; later calls do nothing. */
export function markOnce(mark: PaintMark): void {
  if (performance.getEntriesByName(mark).length > 0) return;
  performance.mark(mark);
  painted();
}
