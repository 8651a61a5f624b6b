import type { Plotted } from '../../twin/plotted.ts';

const TYPE = 'application/x-posecast-value';

interface Dragged {
  readonly dataTransfer: DataTransfer | null;
}

/** Lets cells with a field and a label be dragged. */
export function carryValues(root: HTMLElement): void {
  root.addEventListener('dragstart', (event) => {
    const { field, label } = (event.target as HTMLElement).dataset ?? {};
    if (field === undefined || label === undefined || event.dataTransfer === null) return;
    event.dataTransfer.effectAllowed = 'copy';
    event.dataTransfer.setData(TYPE, JSON.stringify([field, label]));
  });
}

/** Whether a drag brings a value. Which one, only a drop tells. */
export function bringsValue({ dataTransfer }: Dragged): boolean {
  return dataTransfer?.types.includes(TYPE) ?? false;
}

/** null for anything else that may be dropped. */
export function broughtValue({ dataTransfer }: Dragged): Plotted | null {
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
