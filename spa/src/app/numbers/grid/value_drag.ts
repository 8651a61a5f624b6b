import type { Trace } from '../../../twin/plots/trace.ts';
import { addTrace } from '../../state/traces.ts';

const TYPE = 'application/x-posecast-value';
/** The drop target for values: the tab of the plots and its content. */
const PLOTS = '#tab-Plots, #panel-Plots';

/** Lets cells with a field and a label be dragged into the plots of their panel. `dropped` is called after a drop. */
export function carryValues(panel: HTMLElement, dropped: () => void): void {
  panel.addEventListener('dragstart', ({ target, dataTransfer }) => {
    const { field, label } = (target as HTMLElement).dataset ?? {};
    if (field === undefined || label === undefined || dataTransfer === null) return;
    dataTransfer.effectAllowed = 'copy';
    dataTransfer.setData(TYPE, JSON.stringify([field, label]));
  });
  const overPlots = ({ target }: DragEvent) => (target as Element).closest(PLOTS) !== null;
  panel.addEventListener('dragover', (event) => {
    if (overPlots(event) && event.dataTransfer?.types.includes(TYPE)) event.preventDefault();
  });
  panel.addEventListener('drop', (event) => {
    const value = overPlots(event) ? broughtValue(event.dataTransfer) : null;
    if (value === null) return;
    event.preventDefault();
    addTrace(value);
    dropped();
  });
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
