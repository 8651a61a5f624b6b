/** Waiting before something that failed for want of a network is tried again: a little longer after each failure, and no
 *  longer at all when there is reason to hope. */

const FIRST_MS = 1000;
const LONGEST_MS = 20_000;

const waiting = new Set<() => void>();

/** Lets everything that waits be tried now: a person asks for it, or the network is back. */
export function retryNow(): void {
  for (const wake of [...waiting]) wake();
}

if (typeof window !== 'undefined') window.addEventListener('online', retryNow);

/** Resolves when it is time for the next try: after 1 s, 2 s, 4 s … 20 s by the number of failures before, each shortened
 *  by chance up to a half; at once on `retryNow`. */
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

/** A server that has said nothing for so long counts as away. */
const SILENT_MS = 8000;

/** Whether a server answers at this address, whatever it says, as long as the fault is not its own. */
export async function answers(url: string): Promise<boolean> {
  try {
    const signal = AbortSignal.timeout(SILENT_MS);
    return (await fetch(url, { method: 'HEAD', cache: 'no-store', signal })).status < 500;
  } catch {
    return false;
  }
}
