import { createStore } from '../../browser/store.ts';
import type { Trace } from '../../twin/plots/trace.ts';
import { useStore } from './use_store.ts';

/** Most traces at one time; more could not be told apart. */
export const MOST_TRACES = 8;

/** The plotted values, oldest first. There is one list for the page, which is cleared with the robot. */
const list = createStore<readonly Trace[]>([]);

export const traces = list.get;
export const onTraces = list.subscribe;

export function isPlotted({ field, label }: Trace): boolean {
  return traces().some((one) => one.field === field && one.label === label);
}

export function addTrace(value: Trace): void {
  if (isPlotted(value) || traces().length >= MOST_TRACES) return;
  list.set([...traces(), { field: value.field, label: value.label }]);
}

export function removeTrace({ field, label }: Trace): void {
  list.set(traces().filter((one) => one.field !== field || one.label !== label));
}

export function toggleTrace(value: Trace): void {
  if (isPlotted(value)) removeTrace(value);
  else addTrace(value);
}

export function clearTraces(): void {
  if (traces().length > 0) list.set([]);
}

export function useTraces(): readonly Trace[] {
  return useStore(list);
}
