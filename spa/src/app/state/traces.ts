import { useSyncExternalStore } from 'react';
import type { Trace } from '../../twin/plots/trace.ts';

/** As many traces can be told apart. */
export const MOST_TRACES = 8;

/** What is plotted, oldest first. One list for the page; it goes with the robot. */
let list: readonly Trace[] = [];
const listeners = new Set<() => void>();

export function traces(): readonly Trace[] {
  return list;
}

export function isPlotted({ field, label }: Trace): boolean {
  return list.some((one) => one.field === field && one.label === label);
}

export function addTrace(value: Trace): void {
  if (isPlotted(value) || list.length >= MOST_TRACES) return;
  become([...list, { field: value.field, label: value.label }]);
}

export function removeTrace({ field, label }: Trace): void {
  become(list.filter((one) => one.field !== field || one.label !== label));
}

export function toggleTrace(value: Trace): void {
  if (isPlotted(value)) removeTrace(value);
  else addTrace(value);
}

export function clearTraces(): void {
  if (list.length > 0) become([]);
}

export function onTraces(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

export function useTraces(): readonly Trace[] {
  return useSyncExternalStore(onTraces, traces);
}

function become(next: readonly Trace[]): void {
  list = next;
  for (const listener of listeners) listener();
}
