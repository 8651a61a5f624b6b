import { BundleError, serveFolder } from '../../../model/bundle.ts';
import { PastError } from '../../../past/past_source.ts';
import {
  BYTES_MAX,
  FetchedFiles,
  modelPath,
  RECORDING_FILE,
  type RecordingFiles,
} from '../../../past/recording/recording_files.ts';
import { type RecordingIndex, readIndex } from '../../../past/recording/recording_index.ts';
import { early } from '../../../relay/relay.ts';
import { request } from '../../../relay/request.ts';
import type { OfferedFile } from '../../past/save/Outcome.tsx';

/** A recording whose index has been read. */
export interface OpenedRecording {
  /** A unique name among all recordings that this page has opened. */
  readonly id: string;
  readonly index: RecordingIndex;
  readonly files: RecordingFiles;
  /** Where the model's files are, for whatever loads them. */
  readonly manifestUrl: (modelHash: string) => string;
  /** The whole recording for other programs, beside the page. */
  readonly offered: readonly OfferedFile[];
}

let opened = 0;
/** Stops serving the model files of the previously opened recording. */
let endServing = () => {};

/** Opens the recording whose `recording.json` is at an address. Rejects with `IndexError` or `PastError`. */
export async function fetchRecording(url: string): Promise<OpenedRecording> {
  const folder = new URL('.', url).href;
  const files = new FetchedFiles(folder, {
    fetch: (file, init) => {
      const { request: begun } = early;
      early.request = null; // the early request answers only the first fetch
      if (begun === null) return request(file, init);
      init.signal?.addEventListener('abort', () => begun.stop.abort());
      return begun.answer;
    },
    later: (ms, run) => {
      const timer = setTimeout(run, ms);
      return () => clearTimeout(timer);
    },
  });
  const name = url.slice(folder.length);
  const index = readIndex(await files.read(name, BYTES_MAX.index));
  const manifestUrl = (model: string) => folder + modelPath(model, 'manifest.json');
  return { id: url, index, files, manifestUrl, offered: offeredFiles(folder, index.robot) };
}

/** Opens a recording from files on this computer. Rejects with `IndexError` or `PastError`. */
export async function openRecording(files: RecordingFiles): Promise<OpenedRecording> {
  const index = readIndex(await files.read(RECORDING_FILE, BYTES_MAX.index));
  opened += 1;
  const folder = `recording:${opened}/`;
  endServing();
  endServing = serveFolder(folder, async (path, most) => {
    try {
      return await files.read(path, most);
    } catch (error) {
      if (!(error instanceof PastError)) throw error;
      throw new BundleError(error.message);
    }
  });
  const manifestUrl = (model: string) => folder + modelPath(model, 'manifest.json');
  return { id: folder, index, files, manifestUrl, offered: [] };
}

/** What this page was exported with: `<meta name="posecast-data" content="data.csv 81506 data.mcap 46033">`. */
function offeredFiles(folder: string, robot: string): OfferedFile[] {
  const meta = document.querySelector<HTMLMetaElement>('meta[name="posecast-data"]');
  const found = (meta?.content ?? '').matchAll(/\b(data\.(csv|mcap)) (\d+)/g);
  return [...found].map(([, file, format, bytes]) => ({
    format: format!.toUpperCase(),
    url: folder + file,
    name: `${robot}.${format}`,
    bytes: Number(bytes),
  }));
}
