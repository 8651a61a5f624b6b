/** Resolves when what the page has drawn so far is on the screen (at once on a hidden page). Setting up 3D takes seconds on a
 *  slow device, and the stick figure should be visible first. */
export async function afterNextPaint(): Promise<void> {
  await new Promise<void>((done) => {
    if (document.hidden) done();
    else requestAnimationFrame(() => setTimeout(done)); // the browser paints between the two callbacks
  });
  performance.mark('posecast:scene');
}
