import { localFiles } from '../../../urdf/dropped_files.ts';
import type { LocalFiles } from '../../../urdf/local_files.ts';
import { type LocalRobot, openLocal, urdfsIn } from '../../../urdf/local_robot.ts';
import { refusalWords } from './refusals.ts';

/** Reading a robot from this computer: all this comes with the first drop. */

/** What was dropped on the page last. It lives as long as the page and is never sent. */
export type Local =
  | { phase: 'none' }
  | { phase: 'reading' }
  | { phase: 'shown'; robot: LocalRobot; files: LocalFiles; urdfs: readonly string[] }
  | { phase: 'refused'; why: string };

/** The first URDF of the files, or why there is none. */
export async function readFiles(gather: () => Promise<ReadonlyMap<string, File>>): Promise<Local> {
  try {
    const files = await localFiles(await gather());
    const urdfs = urdfsIn(files);
    return { phase: 'shown', robot: await openLocal(files, urdfs[0]!), files, urdfs };
  } catch (cause) {
    return { phase: 'refused', why: refusalWords(cause) };
  }
}

/** Another URDF of the same files. */
export async function readOther(shown: Extract<Local, { phase: 'shown' }>, path: string): Promise<Local> {
  const { files, urdfs } = shown;
  try {
    return { phase: 'shown', robot: await openLocal(files, path), files, urdfs };
  } catch (cause) {
    return { phase: 'refused', why: refusalWords(cause) };
  }
}
