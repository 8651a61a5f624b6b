import { useEffect, useState } from 'react';
import { untilRetry } from '../../../browser/retry.ts';
import { PastError } from '../../../past/past_source.ts';
import { recordingUrl } from '../../../relay/relay.ts';
import { fetchRecording, type OpenedRecording } from './opened_recording.ts';

/** The recording that this page was exported with, or the reason that it can't be read; null while it is loading. */
export function useFetched(wanted: boolean): OpenedRecording | Error | null {
  const [fetched, setFetched] = useState<OpenedRecording | Error | null>(null);
  useEffect(() => {
    const url = recordingUrl();
    if (!wanted || url === null) return;
    let left = false;
    const fetchIt = async () => {
      for (let failures = 1; !left; failures += 1) {
        const found = await fetchRecording(url).catch((error: unknown) => asError(error));
        if (!left) setFetched(found);
        if (!(found instanceof PastError && found.why === 'away')) return;
        await untilRetry(failures);
      }
    };
    void fetchIt();
    return () => {
      left = true;
    };
  }, [wanted]);
  return fetched;
}

function asError(error: unknown): Error {
  return error instanceof Error ? error : new Error(String(error));
}
