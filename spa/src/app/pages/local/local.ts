import { createStore } from '../../../browser/store.ts';
import { useStore } from '../../state/use_store.ts';
import type { Local } from './local_files.ts';

const local = createStore<Local>({ phase: 'none' });
let turn = 0;

export function useLocal(): Local {
  return useStore(local);
}

export function closeLocal(): void {
  turn += 1;
  local.set({ phase: 'none' });
}

/** Shows what is read; the newest wins. */
async function show(read: (code: typeof import('./local_files.ts')) => Promise<Local>): Promise<void> {
  turn += 1;
  const mine = turn;
  local.set({ phase: 'reading' });
  const next = await import('./local_files.ts')
    .then(read)
    .catch((cause: unknown): Local => ({ phase: 'refused', why: String(cause) }));
  if (mine === turn) local.set(next);
}

/** Reads files, dropped or chosen. */
export function openFiles(gather: () => Promise<ReadonlyMap<string, File>>): Promise<void> {
  return show(({ readFiles }) => readFiles(gather));
}

/** Shows another URDF of the same files. One that can't be read is refused; the one before stays away. */
export async function chooseUrdf(path: string): Promise<void> {
  const before = local.get();
  if (before.phase === 'shown') await show(({ readOther }) => readOther(before, path));
}

/** Lets files fall anywhere on the page. Returns the end of it. */
export function listenForDrops(): () => void {
  const over = (event: DragEvent) => {
    if (event.dataTransfer?.types.includes('Files')) event.preventDefault();
  };
  const drop = (event: DragEvent) => {
    // Asked for at once: the list is empty after this event. A file is had without its entry, whatever program it is from.
    const dropped = [...(event.dataTransfer?.items ?? [])].map((item) => {
      const entry = item.webkitGetAsEntry();
      return entry?.isDirectory ? entry : item.getAsFile();
    });
    const things = dropped.filter((thing) => thing !== null);
    if (things.length === 0) return;
    event.preventDefault();
    void openFiles(async () => (await import('../../../urdf/dropped_files.ts')).filesOf(things));
  };
  window.addEventListener('dragover', over);
  window.addEventListener('drop', drop);
  return () => {
    window.removeEventListener('dragover', over);
    window.removeEventListener('drop', drop);
  };
}

/** The files of an `<input type="file">`, with their folders where it knows them. */
export function openChosen(list: FileList | null): void {
  const files = new Map([...(list ?? [])].map((file) => [file.webkitRelativePath || file.name, file]));
  if (files.size > 0) void openFiles(async () => files);
}
