import { createStore } from '../../kit.ts';
import type { Trace } from '../../twin/plots/trace.ts';
import { useStore } from './use_store.ts';

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
