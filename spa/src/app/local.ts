import { useSyncExternalStore } from 'react';
import type { LocalRobot } from '../drop/local_robot.ts';

/** What was dropped on the page last. It lives as long as the page and is never sent. */
export type Local =
  | { phase: 'none' }
  | { phase: 'reading' }
  | { phase: 'shown'; robot: LocalRobot }
  | { phase: 'refused'; why: string };

let current: Local = { phase: 'none' };
let turn = 0;
const listeners = new Set<() => void>();

function become(next: Local): void {
  current = next;
  for (const listener of listeners) listener();
}

export function useLocal(): Local {
  return useSyncExternalStore(
    (listener) => {
      listeners.add(listener);
      return () => listeners.delete(listener);
    },
    () => current,
  );
}

export function closeLocal(): void {
  turn += 1;
  become({ phase: 'none' });
}

/** Reads files, dropped or chosen; the newest drop wins. */
export async function openFiles(gather: () => Promise<ReadonlyMap<string, File>>): Promise<void> {
  turn += 1;
  const mine = turn;
  become({ phase: 'reading' });
  let next: Local;
  try {
    const { localFiles } = await import('../drop/files.ts');
    const { openLocal } = await import('../drop/local_robot.ts');
    next = { phase: 'shown', robot: await openLocal(await localFiles(await gather())) };
  } catch (cause) {
    next = { phase: 'refused', why: cause instanceof Error ? cause.message : String(cause) };
  }
  if (mine === turn) become(next);
}

/** Lets files fall anywhere on the page. Returns the end of it. */
export function listenForDrops(): () => void {
  const over = (event: DragEvent) => {
    if (event.dataTransfer?.types.includes('Files')) event.preventDefault();
  };
  const drop = (event: DragEvent) => {
    const items = [...(event.dataTransfer?.items ?? [])];
    // Asked for at once: the list is empty after this event.
    const entries = items.map((item) => item.webkitGetAsEntry()).filter((entry) => entry !== null);
    if (entries.length === 0) return;
    event.preventDefault();
    void openFiles(async () => (await import('../drop/files.ts')).filesOf(entries));
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
