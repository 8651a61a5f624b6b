import { localFiles } from '../../../urdf/dropped_files.ts';
import type { LocalFiles } from '../../../urdf/local_files.ts';
import { type LocalRobot, openLocal, urdfsIn } from '../../../urdf/local_robot.ts';
import { refusalWords } from './refusals.ts';

/** Reads a robot from files of this computer. This chunk is loaded when files are opened for the first time. */

/** The robot opened from files of this computer, or how far reading it is. It is kept in this page only and never sent.
 *  `urdfs`: paths of all URDFs among `files`; `why`: why the files were refused, in one line. */
export type Local =
  | { phase: 'none' }
  | { phase: 'reading' }
  | { phase: 'shown'; robot: LocalRobot; files: LocalFiles; urdfs: readonly string[] }
  | { phase: 'refused'; why: string };

/** Opens the likeliest URDF among the files that `gather` resolves to. Never rejects: errors give the phase `refused`. */
export async function readFiles(gather: () => Promise<ReadonlyMap<string, File>>): Promise<Local> {
  try {
    const files = await localFiles(await gather());
    const urdfs = await urdfsIn(files);
    return { phase: 'shown', robot: await openLocal(files, urdfs[0]!), files, urdfs };
  } catch (cause) {
    return { phase: 'refused', why: refusalWords(cause) };
  }
}

/** Opens the URDF at `path` among the files already shown. Never rejects: errors give the phase `refused`. */
export async function readOther(shown: Extract<Local, { phase: 'shown' }>, path: string): Promise<Local> {
  const { files, urdfs } = shown;
  try {
    return { phase: 'shown', robot: await openLocal(files, path), files, urdfs };
  } catch (cause) {
    return { phase: 'refused', why: refusalWords(cause) };
  }
}
