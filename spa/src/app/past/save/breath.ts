/** For so long the page is kept busy at a time, ms. */
const BUSY_MS = 12;

/** Returns a function to call often during long work: now and then it lets the page draw and answer. It does so by messages, since
 *  timers of a page in the background are slow. */
export function breaths(): () => Promise<void> {
  const { port1, port2 } = new MessageChannel();
  let begunMs = performance.now();
  return async () => {
    if (performance.now() - begunMs < BUSY_MS) return;
    await new Promise<void>((resolve) => {
      port1.onmessage = () => resolve();
      port2.postMessage(null);
    });
    begunMs = performance.now();
  };
}
