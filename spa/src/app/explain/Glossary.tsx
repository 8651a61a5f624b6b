import type { RobotTwin } from '../../twin/robot.ts';
import { Dialog } from '../shell/Dialog.tsx';
import { useBalanceText } from '../text/balance.ts';
import { useMore } from '../text/more.ts';
import { usePastText } from '../text/past.ts';
import { explainFlags } from './asked.ts';
import { type Catalogue, type Explained, SECTIONS } from './catalogue.ts';

/** A dialog with everything that the page explains, and with the flags of this robot. */
export function Glossary(props: { catalogue: Catalogue; twin: RobotTwin; onClose: () => void }) {
  const { catalogue, twin, onClose } = props;
  const text = useMore();
  const pastText = usePastText();
  const balanceText = useBalanceText();
  const titles = {
    words: text.wordsExplained,
    timeLine: pastText.timeLine,
    columns: text.columnsExplained,
    signs: text.signs,
    balance: balanceText.balance,
    sensors: text.sensorsExplained,
    units: text.unitsExplained,
  };
  const flags = explainFlags(twin);
  return (
    <Dialog title={text.allExplained} testId="glossary" onClose={onClose}>
      {SECTIONS.map((section) => (
        <Part key={section} title={titles[section]} entries={Object.entries(catalogue[section])} />
      ))}
      {flags.length > 0 && <Part title={text.flagsExplained} entries={flags} />}
    </Dialog>
  );
}

function Part({ title, entries }: { title: string; entries: readonly (readonly [string, Explained])[] }) {
  return (
    <section className="glossary" aria-label={title}>
      <h3 className="quiet">{title}</h3>
      <dl>
        {entries.map(([key, { name, what, how }]) => (
          <div key={key}>
            <dt>{name}</dt>
            <dd>
              {what} <span className="quiet">{how}</span>
            </dd>
          </div>
        ))}
      </dl>
    </section>
  );
}
