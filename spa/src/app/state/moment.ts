import { useSyncExternalStore } from 'react';
import { createStore } from '../../kit.ts';
import type { PastControls } from '../../past/past_types.ts';
import { queryOf } from './settings.ts';

/** The moment of the past that the page shows, unix ms by the relay's clock; null while it shows the present. */
export const shownMoment = createStore<number | null>(null);

/** Draws a component again when another second of the past is shown. */
export function useShownSecond(): void {
  useSyncExternalStore(shownMoment.subscribe, () => Math.floor((shownMoment.get() ?? 0) / 1000));
}

/** The controls of the shown robot's past; null while there is none to look back on. */
export const pastControls = createStore<PastControls | null>(null);

/** How an address names a moment: "2026-11-22T14:02:07.250Z", rounded up, so that the frame shown at it is not after it. */
export function formatMoment(momentMs: number): string {
  return new Date(Math.ceil(momentMs)).toISOString();
}

/** The moment that an address names: `#/r/demo?t=2026-11-22T14:02:07.250Z`; null if it names none that can be read. */
export function momentIn(hash: string): number | null {
  const named = queryOf(hash).get('t');
  if (named === null || !/^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,3})?Z$/.test(named)) return null;
  const ms = Date.parse(named);
  return Number.isFinite(ms) ? ms : null;
}
