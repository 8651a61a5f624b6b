import { localFiles } from '../urdf/dropped_files.ts';
import { openLocal, urdfsIn } from '../urdf/local_robot.ts';
import type { Local } from './local.ts';
import { refusalWords } from './refusals.ts';

/** Reading a robot from this computer: all this comes with the first drop. */

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
