import { answers, untilRetry } from '../../browser/retry.ts';
import type { ModelReport } from '../../model/report.ts';

/** Loads the model at `url` with `load` and reports the result. If something failed to load for a temporary reason, it is loaded
 *  again, but only once its server answers, because loading removes what is shown. Returns a function that stops this; nothing is
 *  reported after that. */
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
