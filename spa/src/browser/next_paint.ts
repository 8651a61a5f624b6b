/** Resolves when what the page has drawn so far is on the screen: setting up 3D takes a slow device seconds, and the lines that
 *  are there come first. A hidden page has nothing to wait for. */
export async function afterNextPaint(): Promise<void> {
  await new Promise<void>((done) => {
    if (document.hidden) done();
    else requestAnimationFrame(() => setTimeout(done)); // the picture goes out between the two
  });
  performance.mark('posecast:scene');
}
