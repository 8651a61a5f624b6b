import { createStore } from '../../../kit.ts';
import { useStore } from '../../state/hooks.ts';
import type { Local } from './local_files.ts';

/** The robot or recording opened from files on this computer; the page has one at most. */
const local = createStore<Local>({ phase: 'none' });
/** Counts loads, so that the result of a superseded one is dropped. */
let turn = 0;

/** The robot opened from files on this computer, or the loading state. The component is redrawn when that changes. */
export function useLocal(): Local {
  return useStore(local);
}

/** Closes the robot opened from files, and cancels one that is loading. */
export function closeLocal(): void {
  turn += 1;
  local.set({ phase: 'none' });
}

/** Shows the result of `read`, unless a newer load has started meanwhile. */
async function show(read: (code: typeof import('./local_files.ts')) => Promise<Local>): Promise<void> {
  turn += 1;
  const mine = turn;
  local.set({ phase: 'reading' });
  const next = await import('./local_files.ts')
    .then(read)
    .catch((cause: unknown): Local => ({ phase: 'refused', why: String(cause) }));
  if (mine === turn) local.set(next);
}

/** Opens a robot or a recording from dropped files. Never rejects: the page shows why they were refused. */
function openDropped(things: readonly (FileSystemEntry | File)[]): Promise<void> {
  return show(({ readDropped }) => readDropped(things));
}

/** Shows another URDF from the same files. If it can't be read, the page shows the reason instead of the previous URDF. Does
 *  nothing while no robot is shown. */
export async function chooseUrdf(path: string): Promise<void> {
  const before = local.get();
  if (before.phase === 'shown') await show(({ readOther }) => readOther(before, path));
}

/** Opens files and folders that are dropped anywhere on the page. Returns a function that stops it. */
export function listenForDrops(): () => void {
  const over = (event: DragEvent) => {
    if (event.dataTransfer?.types.includes('Files')) event.preventDefault();
  };
  const drop = (event: DragEvent) => {
    // Must be read synchronously: the list is empty after this event. Single files are not read through their entries, because
    // some programs drop files without entries.
    const dropped = [...(event.dataTransfer?.items ?? [])].map((item) => {
      const entry = item.webkitGetAsEntry();
      return entry?.isDirectory ? entry : item.getAsFile();
    });
    const things = dropped.filter((thing) => thing !== null);
    if (things.length === 0) return;
    event.preventDefault();
    void openDropped(things);
  };
  window.addEventListener('dragover', over);
  window.addEventListener('drop', drop);
  return () => {
    window.removeEventListener('dragover', over);
    window.removeEventListener('drop', drop);
  };
}

/** Opens the files of an `<input type="file">`, by their paths where a folder was chosen. Does nothing if there are
 *  none. */
export function openChosen(list: FileList | null): void {
  const files = new Map([...(list ?? [])].map((file) => [file.webkitRelativePath || file.name, file]));
  if (files.size > 0) void show(({ readChosen }) => readChosen(files));
}
