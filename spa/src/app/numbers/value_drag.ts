import type { Trace } from '../../twin/plots/trace.ts';
import { addTrace } from '../state/viewing.ts';

const TYPE = 'application/x-posecast-value';
/** The drop target for values: the tab of the plots and its content. */
const PLOTS = '#tab-Plots, #panel-Plots';

/** Lets cells with a field and a label be dragged into the plots of their panel. `dropped` is called after a drop. Returns a
 *  function that stops it. */
export function carryValues(panel: HTMLElement, dropped: () => void): () => void {
  const end = new AbortController();
  const { signal } = end;
  const start = ({ target, dataTransfer }: DragEvent) => {
    const { field, label } = (target as HTMLElement).dataset ?? {};
    if (field === undefined || label === undefined || dataTransfer === null) return;
    dataTransfer.effectAllowed = 'copy';
    dataTransfer.setData(TYPE, JSON.stringify([field, label]));
  };
  const overPlots = ({ target }: DragEvent) => (target as Element).closest(PLOTS) !== null;
  const over = (event: DragEvent) => {
    if (overPlots(event) && event.dataTransfer?.types.includes(TYPE)) event.preventDefault();
  };
  const drop = (event: DragEvent) => {
    const value = overPlots(event) ? broughtValue(event.dataTransfer) : null;
    if (value === null) return;
    event.preventDefault();
    addTrace(value);
    dropped();
  };
  panel.addEventListener('dragstart', start, { signal });
  panel.addEventListener('dragover', over, { signal });
  panel.addEventListener('drop', drop, { signal });
  return () => end.abort();
}

/** The dragged value; null if something else was dropped. */
function broughtValue(dataTransfer: DataTransfer | null): Trace | null {
  let carried: unknown = null;
  try {
    carried = JSON.parse(dataTransfer?.getData(TYPE) ?? 'null');
  } catch {
    // not ours
  }
  if (!Array.isArray(carried)) return null;
  const [field, label] = carried as unknown[];
  return typeof field === 'string' && typeof label === 'string' ? { field, label } : null;
}
