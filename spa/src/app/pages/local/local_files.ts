import { isolated } from '../../../twin/names.ts';
import { filesOf, localFiles } from '../../../urdf/dropped_files.ts';
import { DropError, type LocalFiles, typedPath } from '../../../urdf/local_files.ts';
import { type LocalRobot, openLocal, urdfsIn } from '../../../urdf/local_robot.ts';
import { more } from '../../text/language.ts';
import type { OpenedRecording } from '../recording/opened_recording.ts';

/** Reads a robot or a recording from files on this computer. This chunk is loaded when files are opened for the first time. */

/** The robot or recording opened from files on this computer, or the loading state. It stays in this page and is never sent.
 *  `urdfs`: paths of all URDFs among `files`; `why`: why the files were refused, in one line. */
export type Local =
  | { phase: 'none' }
  | { phase: 'reading' }
  | { phase: 'shown'; robot: LocalRobot; files: LocalFiles; urdfs: readonly string[] }
  | { phase: 'recording'; opened: OpenedRecording }
  | { phase: 'refused'; why: string };

/** Opens dropped files: a recording if there is one, otherwise the likeliest URDF. Never rejects: errors give the phase
 *  `refused`. */
export async function readDropped(things: readonly (FileSystemEntry | File)[]): Promise<Local> {
  return (
    (await readRecording(({ recordingDropped }) => recordingDropped(things))) ??
    readRobot(() => filesOf(things))
  );
}

/** The same for files chosen in a dialog, by their paths. */
export async function readChosen(files: ReadonlyMap<string, File>): Promise<Local> {
  return (
    (await readRecording(({ recordingChosen }) => recordingChosen(files))) ?? readRobot(async () => files)
  );
}

/** The recording among files, or why it can't be opened; null if there is none. */
async function readRecording(
  open: (code: typeof import('../recording/local_recording.ts')) => Promise<Local | null>,
): Promise<Local | null> {
  try {
    return await open(await import('../recording/local_recording.ts'));
  } catch (cause) {
    return { phase: 'refused', why: refusalWords(cause) };
  }
}

async function readRobot(gather: () => Promise<ReadonlyMap<string, File>>): Promise<Local> {
  try {
    const files = await localFiles(await gather());
    const urdfs = await urdfsIn(files);
    return { phase: 'shown', robot: await openLocal(files, urdfs[0]!), files, urdfs };
  } catch (cause) {
    return { phase: 'refused', why: refusalWords(cause) };
  }
}

/** Opens the URDF at `path` among the files already open. Never rejects: errors give the phase `refused`. */
export async function readOther(shown: Extract<Local, { phase: 'shown' }>, path: string): Promise<Local> {
  const { files, urdfs } = shown;
  try {
    return { phase: 'shown', robot: await openLocal(files, path), files, urdfs };
  } catch (cause) {
    return { phase: 'refused', why: refusalWords(cause) };
  }
}

/** Why the files were refused, in one line, safe to show. `cause`: the error from reading them. */
export function refusalWords(cause: unknown): string {
  if (!(cause instanceof DropError)) return isolated(cause instanceof Error ? cause.message : String(cause));
  const text = more();
  const { refusal } = cause;
  switch (refusal.why) {
    case 'dropTooMany':
      return text.dropTooMany(refusal.count);
    case 'dropBomb':
    case 'dropTooLarge':
      return text[refusal.why](isolated(refusal.path));
    case 'dropOtherFormat':
      return text.dropOtherFormat(isolated(refusal.path), refusal.format, typedPath(refusal.path));
    case 'dropUnreadable':
      return text.dropUnreadable(isolated(refusal.path), isolated(refusal.what));
    default:
      return text[refusal.why];
  }
}
