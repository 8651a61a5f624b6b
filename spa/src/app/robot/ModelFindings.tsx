import '../shell/styles/findings.css';
import type { ModelReport } from '../../model/report.ts';
import { isolated } from '../../twin/names.ts';
import { useMore } from '../text/more.ts';
import { remarksWords } from './words.ts';

/** A note that expands to what the edge's doctor found wrong with the model. Hints are left out, because only the model's author
 *  needs them. */
export function ModelFindings({ findings = [] }: { findings: ModelReport['findings'] | undefined }) {
  const said = useMore();
  const shown = findings.filter(({ severity }) => severity !== 'hint');
  if (shown.length === 0) return null;
  return (
    <details className="model-findings" data-testid="model-findings">
      <summary>{remarksWords(shown.length)}</summary>
      <ul>
        {shown.map(({ severity, line, text }) => (
          <li key={`${line} ${text}`} data-severity={severity}>
            {isolated(text)}
            {line !== null && <span className="quiet"> · {said.line(line)}</span>}
          </li>
        ))}
      </ul>
    </details>
  );
}
