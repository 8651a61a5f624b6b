/** What a viewer has seen so far, on the browser's own time line: for measurements. */
type Sight = 'posecast:skeleton' | 'posecast:skin';

/** A robot may have no body, or none yet. */
const LONGEST_MS = 2000;

let seen = () => {};
/** On a slow line the first bytes belong to the body. What can wait for the first sight of it, waits for this. */
export const firstSight = new Promise<void>((done) => {
  seen = done;
});
setTimeout(seen, LONGEST_MS);

export function markOnce(sight: Sight): void {
  if (performance.getEntriesByName(sight).length > 0) return;
  performance.mark(sight);
  seen();
}
