/** Marks on the browser's performance time line: when the robot was first drawn as lines, and first with its meshes. */
type PaintMark = 'posecast:skeleton' | 'posecast:skin';

/** `firstPaint` waits no longer than this, because a robot may have no model. */
const LONGEST_MS = 2000;

let painted = () => {};
const drawn = new Promise<void>((done) => {
  painted = done;
});
let waiting = false;

/** Resolves when a robot was first drawn, or 2 s after the first call, because a viewer may stay on the list for long. Less
 *  urgent loading waits for it, so that the body comes first on a slow connection. */
export function firstPaint(): Promise<void> {
  if (!waiting) setTimeout(painted, LONGEST_MS);
  waiting = true;
  return drawn;
}

/** Sets a performance mark once, and resolves `firstPaint`. */
export function markOnce(mark: PaintMark): void {
  if (performance.getEntriesByName(mark).length > 0) return;
  performance.mark(mark);
  painted();
}

/** Resolves when what the page has drawn so far is on the screen (at once on a hidden page). Setting up 3D takes seconds on a
 *  slow device, and the stick figure should be visible first. */
export async function afterNextPaint(): Promise<void> {
  await new Promise<void>((done) => {
    if (document.hidden) done();
    else requestAnimationFrame(() => setTimeout(done)); // the browser paints between the two callbacks
  });
  performance.mark('posecast:scene');
}

/** Whether the viewer's system asks for reduced motion; if so, nothing is animated. */
export function prefersReducedMotion(): boolean {
  return window.matchMedia('(prefers-reduced-motion: reduce)').matches;
}
