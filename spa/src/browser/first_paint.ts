/** Marks on the browser's performance time line: when the robot was first drawn as lines, and with its meshes. */
type PaintMark = 'posecast:skeleton' | 'posecast:skin';

/** `firstPaint` waits no longer than this, because a robot may have no model. */
const LONGEST_MS = 2000;

let painted = () => {};
/** Resolves when the robot was first drawn, or after 2 s. Less urgent loading waits for it, so that the body comes
 *  first on a slow line. */
export const firstPaint = new Promise<void>((done) => {
  painted = done;
});
setTimeout(painted, LONGEST_MS);

/** Sets a performance mark once, and resolves `firstPaint`. */
export function markOnce(mark: PaintMark): void {
  if (performance.getEntriesByName(mark).length > 0) return;
  performance.mark(mark);
  painted();
}
