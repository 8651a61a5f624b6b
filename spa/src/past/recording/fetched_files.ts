import { answerBytes } from '../answer_bytes.ts';
import { PastError } from '../past_source.ts';
import type { RecordingFiles } from './recording_files.ts';

/** Delay before the second try after a failure, ms. Whoever needs the file asks again later. */
const RETRY_MS = 500;
/** A host that is silent for this long counts as unreachable, ms. */
const SILENT_MS = 20_000;

export interface FetchPorts {
  readonly fetch: (url: string, init: RequestInit) => Promise<Response>;
  /** Calls `run` after `ms`. Returns a function that cancels it. */
  readonly later: (ms: number, run: () => void) => () => void;
}

/** The result of one try: the bytes, or why there are none. */
type Tried = Uint8Array<ArrayBuffer> | 'cut' | 'no answer';

/** The files of a recording on a web server, below a folder's URL. */
export class FetchedFiles implements RecordingFiles {
  /** `folder` ends with a slash. */
  constructor(
    private readonly folder: string,
    private readonly ports: FetchPorts,
  ) {}

  async read(path: string, most: number, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>> {
    const first = await this.#try(path, most, signal);
    if (typeof first !== 'string') return first;
    await new Promise<void>((resolve) => this.ports.later(RETRY_MS, resolve));
    signal?.throwIfAborted();
    const second = await this.#try(path, most, signal);
    if (typeof second !== 'string') return second;
    // a host that fails twice keeps failing; if the network is down, the second try gets no answer at all
    const isCut = first === 'cut' && second === 'cut';
    throw isCut
      ? new PastError('damaged', `${path}: the answer broke off`)
      : new PastError('away', `${path}: no answer`);
  }

  async #try(path: string, most: number, signal?: AbortSignal): Promise<Tried> {
    const silent = new AbortController();
    let calledOff = () => {};
    const heard = () => {
      calledOff();
      calledOff = this.ports.later(SILENT_MS, () => silent.abort());
    };
    heard();
    let tried: Tried = 'no answer';
    try {
      const url = new URL(path, this.folder).href;
      const either = signal === undefined ? silent.signal : AbortSignal.any([signal, silent.signal]);
      const response = await this.ports.fetch(url, { signal: either });
      const { status } = response;
      if (status === 200) {
        tried = 'cut';
        return await answerBytes(response, path, most, heard);
      }
      await response.body?.cancel();
      if (status >= 400 && status < 500 && status !== 429)
        throw new PastError('gone', `${path}: answered ${status}`);
      return tried;
    } catch (error) {
      signal?.throwIfAborted();
      if (error instanceof PastError) throw error;
      return silent.signal.aborted ? 'no answer' : tried;
    } finally {
      calledOff();
    }
  }
}
