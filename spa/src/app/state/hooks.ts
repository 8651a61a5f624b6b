import { useEffect, useEffectEvent, useReducer, useSyncExternalStore } from 'react';
import type { Store } from '../../kit.ts';

/** The value of a store. The component is drawn again when it changes. */
export function useStore<T>(store: Pick<Store<T>, 'get' | 'subscribe'>): T {
  return useSyncExternalStore(store.subscribe, store.get);
}

/** Between two ticks. */
const TICK_MS = 250;

/** The listeners of the page's only timer, with the number of ticks between two calls. */
const ticked = new Map<() => void, number>();
let ticks = 0;
let timer: ReturnType<typeof setInterval> | undefined;

function tick(): void {
  if (document.hidden) return;
  ticks += 1;
  for (const [listener, every] of ticked) if (ticks % every === 0) listener();
}

/** A page that was hidden shows at once what has changed. */
function catchUp(): void {
  if (document.hidden) return;
  for (const listener of ticked.keys()) listener();
}

/** Calls `listener` about every `everyMs` while the page is visible. Returns a function that stops it. */
export function onTick(everyMs: number, listener: () => void): () => void {
  if (ticked.size === 0) {
    timer = setInterval(tick, TICK_MS);
    document.addEventListener('visibilitychange', catchUp);
  }
  ticked.set(listener, Math.max(1, Math.round(everyMs / TICK_MS)));
  return () => {
    ticked.delete(listener);
    if (ticked.size > 0) return;
    clearInterval(timer);
    document.removeEventListener('visibilitychange', catchUp);
  };
}

/** What `read` returns, for texts and numbers that change with time, without an event. The component is drawn again if that has
 *  changed, which is checked every `everyMs`. It must be plain data (JSON). */
export function useTicked<T>(everyMs: number, read: () => T): T {
  const [, draw] = useReducer((count: number) => count + 1, 0);
  const value = read();
  const look = useEffectEvent(() => {
    if (JSON.stringify(read()) !== JSON.stringify(value)) draw();
  });
  useEffect(() => onTick(everyMs, () => look()), [everyMs]);
  return value;
}
