import { useSyncExternalStore } from 'react';
import { createStore } from '../../kit.ts';
import type { PastControls } from '../../past/past_types.ts';
import type { Trace } from '../../twin/plots/trace.ts';
import { address, onLink, queryOf } from './address.ts';
import { useStore } from './hooks.ts';

/** The selected joint, by its label in the robot's schema, and where it was selected. */
export interface Selection {
  readonly joint: string;
  readonly from: 'body' | 'numbers';
}

/** One selection for the whole page; null: nothing is selected. */
const selected = createStore<Selection | null>(null);

/** The selected joint; null: none. */
export const selection = selected.get;
/** Adds a listener that is called at each selection. Returns a function that removes it. */
export const onSelection = selected.subscribe;

/** Selects a joint by its label; null: none. Selecting the same joint again also notifies listeners, so that the camera returns
 *  to it. */
export function selectJoint(joint: string | null, from: Selection['from'] = 'numbers'): void {
  if (joint === null && selection() === null) return;
  selected.set(joint === null ? null : { joint, from });
}

/** The label of the selected joint; null: none. The component is drawn again when it changes. */
export function useSelectedJoint(): string | null {
  return useSyncExternalStore(onSelection, () => selection()?.joint ?? null);
}

/** The most values plotted at once; with more, the lines are hard to tell apart. */
export const MOST_TRACES = 8;

/** The plotted values, oldest first. There is one list for the page; it is cleared when the robot is closed. */
const list = createStore<readonly Trace[]>([]);

/** The plotted values, oldest first. */
export const traces = list.get;
/** Adds a listener for changes of `traces`. Returns a function that removes it. */
export const onTraces = list.subscribe;

export function isPlotted({ field, label }: Trace): boolean {
  return traces().some((one) => one.field === field && one.label === label);
}

/** Adds a value to the plots. Does nothing if it is already plotted or there are `MOST_TRACES`. */
export function addTrace(value: Trace): void {
  if (isPlotted(value) || traces().length >= MOST_TRACES) return;
  list.set([...traces(), { field: value.field, label: value.label }]);
}

export function removeTrace({ field, label }: Trace): void {
  list.set(traces().filter((one) => one.field !== field || one.label !== label));
}

/** Removes a value from the plots if it is plotted, and adds it otherwise. */
export function toggleTrace(value: Trace): void {
  if (isPlotted(value)) removeTrace(value);
  else addTrace(value);
}

export function clearTraces(): void {
  if (traces().length > 0) list.set([]);
}

/** The plotted values, oldest first. The component is drawn again when they change. */
export function useTraces(): readonly Trace[] {
  return useStore(list);
}

const named = () => queryOf(address.get()).has('present');

/** Whether the page is shown as for a projector. A link with `present` in its query opens so. */
const inForce = createStore(typeof window !== 'undefined' && named());

/** Whether the page is shown as for a projector. */
export const presenting = inForce.get;
/** Begins or ends presenting. */
export const present = inForce.set;
export const onPresenting = inForce.subscribe;

/** Follows links to and from pages that are to be presented. Returns a function that stops it. */
export function followPresentLinks(): () => void {
  const follow = () => present(named());
  follow();
  return onLink(follow);
}

/** Whether the page is shown as for a projector. The component is drawn again when that changes. */
export function usePresenting(): boolean {
  return useStore(inForce);
}

/** The moment of the past that the page shows, unix ms by the relay's clock; null while it shows the present. */
export const shownMoment = createStore<number | null>(null);

/** Draws a component again when another second of the past is shown. */
export function useShownSecond(): void {
  useSyncExternalStore(shownMoment.subscribe, () => Math.floor((shownMoment.get() ?? 0) / 1000));
}

/** The controls of the shown robot's past; null while there is none to look back on. */
export const pastControls = createStore<PastControls | null>(null);
