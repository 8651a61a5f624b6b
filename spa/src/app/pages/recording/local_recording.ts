import { openPosecastFile, PosecastFileError } from '../../../past/recording/posecast_file.ts';
import {
  type FindFile,
  FolderFiles,
  inChosenFolder,
  inDroppedFolder,
  RECORDING_FILE,
  type RecordingFiles,
} from '../../../past/recording/recording_files.ts';
import { isolated } from '../../../twin/names.ts';
import { recordingText } from '../../text/late.ts';
import { type OpenedRecording, openRecording } from './opened_recording.ts';
import { unreadableWords } from './recording_words.ts';

/** The result of opening files that are, or should be, a recording. */
export type LocalRecording =
  | { readonly phase: 'recording'; readonly opened: OpenedRecording }
  | { readonly phase: 'refused'; readonly why: string };

/** Opens a dropped recording: a folder with a `recording.json`, or a `.posecast` file. null: it is neither. */
export async function recordingDropped(
  things: readonly (FileSystemEntry | File)[],
): Promise<LocalRecording | null> {
  for (const thing of things) {
    if (thing instanceof File || !thing.isDirectory) continue;
    const find = inDroppedFolder(thing as FileSystemDirectoryEntry);
    if ((await find(RECORDING_FILE)) !== null) return opened(new FolderFiles(find));
  }
  const files = things.filter((thing) => thing instanceof File);
  const folders = things.filter((thing): thing is FileSystemDirectoryEntry => !(thing instanceof File));
  const index = files.find(({ name }) => name === RECORDING_FILE);
  if (index !== undefined && folders.length > 0) return opened(new FolderFiles(among(index, folders)));
  return recordingIn(new Map(files.map((file) => [file.name, file])));
}

/** Opens a recording among chosen files, by their paths. null if there is none. */
export async function recordingChosen(files: ReadonlyMap<string, File>): Promise<LocalRecording | null> {
  const roots = [...files.keys()]
    .filter((path) => path === RECORDING_FILE || path.endsWith(`/${RECORDING_FILE}`))
    .map((path) => path.slice(0, -RECORDING_FILE.length));
  const [root] = roots.sort((a, b) => a.length - b.length);
  if (root !== undefined && files.size > 1) return opened(new FolderFiles(inChosenFolder(files, root)));
  return recordingIn(files);
}

/** For single files. */
async function recordingIn(files: ReadonlyMap<string, File>): Promise<LocalRecording | null> {
  if (files.has(RECORDING_FILE)) return refused(recordingText().wholeFolder);
  for (const [path, file] of files) {
    const isOurs = /\.posecast$/i.test(path);
    if (!isOurs && !(files.size === 1 && /\.zip$/i.test(path))) continue;
    try {
      const zip = await openPosecastFile(file);
      if (zip.has(RECORDING_FILE)) return await opened(zip);
      if (isOurs) return refused(recordingText().noneDropped);
    } catch (error) {
      if (!(error instanceof PosecastFileError)) throw error;
      if (isOurs) return refused(recordingText().fileDamaged(isolated(error.message)));
    }
  }
  return null;
}

/** Finds files when the contents of a recording were dropped without their folder. */
function among(index: File, folders: readonly FileSystemDirectoryEntry[]): FindFile {
  return async (path) => {
    if (path === RECORDING_FILE) return index;
    const [first = '', ...rest] = path.split('/');
    const folder = folders.find(({ name }) => name === first);
    return folder === undefined ? null : inDroppedFolder(folder)(rest.join('/'));
  };
}

async function opened(files: RecordingFiles): Promise<LocalRecording> {
  try {
    return { phase: 'recording', opened: await openRecording(files) };
  } catch (error) {
    if (!(error instanceof Error)) throw error;
    return refused(unreadableWords(error));
  }
}

function refused(why: string): LocalRecording {
  return { phase: 'refused', why };
}
