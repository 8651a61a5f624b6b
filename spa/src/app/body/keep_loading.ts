import { answers, untilRetry } from '../../browser/retry.ts';
import type { ModelReport } from '../../model/report.ts';

/** Loads the model at `url` by `load` and reports the result. While something did not come for a reason that passes, it is
 *  loaded again, but not before its server answers, since loading takes away what is shown. Returns a function that
 *  stops it; then nothing is reported any more. */
export function keepLoading(
  url: string,
  load: () => Promise<ModelReport>,
  report: (result: ModelReport) => void,
): () => void {
  let left = false;
  const keepTrying = async () => {
    for (let failures = 1; ; ) {
      const result = await load();
      if (left) return;
      report(result);
      if (result.passing !== true) return;
      do {
        await untilRetry(failures);
        failures += 1;
      } while (!left && !(await answers(url)));
      if (left) return;
    }
  };
  void keepTrying();
  return () => {
    left = true;
  };
}
