/** Waits before retrying after a network failure: a little longer after each failure, and not at all when success has become
 *  likely. */

const FIRST_MS = 1000;
const LONGEST_MS = 20_000;

const waiting = new Set<() => void>();

/** Retries everything that waits, now: the viewer asks for it, or the network is back. */
export function retryNow(): void {
  for (const wake of [...waiting]) wake();
}

if (typeof window !== 'undefined') window.addEventListener('online', retryNow);

/** Resolves when it is time for the next try: after 1 s, 2 s, 4 s … 20 s, depending on the number of failures, each randomly
 *  shortened by up to half; at once on `retryNow`. */
export function untilRetry(failures: number): Promise<void> {
  const longMs = Math.min(LONGEST_MS, FIRST_MS * 2 ** Math.max(0, failures - 1));
  return new Promise((resolve) => {
    const wake = () => {
      waiting.delete(wake);
      clearTimeout(timer);
      resolve();
    };
    const timer = setTimeout(wake, longMs * (1 - Math.random() / 2));
    waiting.add(wake);
  });
}

/** A server that has not answered for this long counts as unreachable. */
const SILENT_MS = 8000;

/** Whether a server answers at this address with any status except a server error. */
export async function answers(url: string): Promise<boolean> {
  try {
    const signal = AbortSignal.timeout(SILENT_MS);
    return (await fetch(url, { method: 'HEAD', cache: 'no-store', signal })).status < 500;
  } catch {
    return false;
  }
}
