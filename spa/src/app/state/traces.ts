import { useSyncExternalStore } from 'react';
import type { Plotted } from '../../twin/plots/trace.ts';

/** As many traces can be told apart. */
export const MOST_TRACES = 8;

/** What is plotted, oldest first. One list for the page; it goes with the robot. */
let list: readonly Plotted[] = [];
const listeners = new Set<() => void>();

export function plotted(): readonly Plotted[] {
  return list;
}

export function isPlotted({ field, label }: Plotted): boolean {
  return list.some((one) => one.field === field && one.label === label);
}

export function plot(value: Plotted): void {
  if (isPlotted(value) || list.length >= MOST_TRACES) return;
  become([...list, { field: value.field, label: value.label }]);
}

export function unplot({ field, label }: Plotted): void {
  become(list.filter((one) => one.field !== field || one.label !== label));
}

export function togglePlot(value: Plotted): void {
  if (isPlotted(value)) unplot(value);
  else plot(value);
}

export function clearPlots(): void {
  if (list.length > 0) become([]);
}

export function onPlotted(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

export function usePlotted(): readonly Plotted[] {
  return useSyncExternalStore(onPlotted, plotted);
}

function become(next: readonly Plotted[]): void {
  list = next;
  for (const listener of listeners) listener();
}
