/** The page is blocked for at most this long at a time, ms. */
const BUSY_MS = 12;

/** Returns a function to call often during long work: now and then it yields, so that the page can draw and respond. It yields by
 *  messages, because browsers slow down timers of background pages. */
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
