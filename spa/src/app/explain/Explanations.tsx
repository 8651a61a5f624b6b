import './explained.css';
import { type CSSProperties, useEffect, useId, useRef, useState } from 'react';
import type { RobotTwin } from '../../twin/robot.ts';
import { Dialog } from '../shell/Dialog.tsx';
import { usePageKeys } from '../shell/page_keys.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { useMore } from '../text/language.ts';
import { useBalanceText, usePastText } from '../text/late.ts';
import {
  type Asked,
  type Catalogue,
  type Explained,
  explain,
  explainedBy,
  explainFlags,
  keysOfLabel,
  placeOf,
  SECTIONS,
  useCatalogue,
} from './catalogue.ts';
import { pressedLabel } from './pressed_sign.ts';

const WIDTH_PX = 320;
const GAP_PX = 6;
const EDGE_PX = 12;

/** Explains any pressed element that has `data-explain`, in a small dialog beside it. `all` is the whole glossary. */
export function Explanations({ link }: { link: RobotLink }) {
  const text = useMore();
  const catalogue = useCatalogue();
  const [asked, setAsked] = useState<Asked | null>(null);
  const [all, setAll] = useState(false);
  const dialog = useRef<HTMLDivElement>(null);
  const [title, words] = [useId(), useId()];
  const { twin } = link;

  useEffect(() => {
    if (catalogue === null) return;
    const onClick = (event: MouseEvent) => {
      const by = (event.target as Element).closest<HTMLElement>('[data-explain]');
      if (by !== null) {
        event.preventDefault();
        event.stopPropagation(); // it must not count as a tap on the surrounding row
        if (by.dataset.explain === 'all') setAll(true);
        else
          setAsked((now) =>
            now?.by === by
              ? null
              : { by, at: by.getBoundingClientRect(), explained: explain(by, catalogue, twin) },
          );
        return;
      }
      const label = pressedLabel({ x: event.clientX, y: event.clientY });
      if (label === null) return;
      const explained = keysOfLabel(label).flatMap((key) => explainedBy(catalogue, key) ?? []);
      setAsked({ by: label, at: placeOf(label, event), explained });
    };
    document.addEventListener('click', onClick, true);
    return () => document.removeEventListener('click', onClick, true);
  }, [catalogue, twin]);

  useEffect(() => {
    if (asked === null) return;
    const { by } = asked;
    by.setAttribute('aria-expanded', 'true');
    dialog.current?.focus();
    const onPress = ({ target }: Event) => {
      if (!dialog.current?.contains(target as Node) && !by.contains(target as Node)) setAsked(null);
    };
    document.addEventListener('pointerdown', onPress, true);
    return () => {
      by.setAttribute('aria-expanded', 'false');
      document.removeEventListener('pointerdown', onPress, true);
    };
  }, [asked]);
  const close = () => {
    setAsked(null);
    asked?.by.focus();
  };
  usePageKeys(asked === null ? null : () => ({ close }), dialog);

  const [first] = asked?.explained ?? [];
  return (
    <>
      {asked !== null && first !== undefined && (
        <div
          className="explained"
          role="dialog"
          tabIndex={-1}
          ref={dialog}
          style={besideStyle(asked.at)}
          aria-labelledby={title}
          aria-describedby={words}
          data-testid="explained"
        >
          <button
            type="button"
            className="explained-close"
            aria-label={text.closeByEscape}
            title={text.closeByEscape}
            onClick={() => setAsked(null)}
          >
            ×
          </button>
          <h3 id={title}>{first.name}</h3>
          <div id={words}>
            {asked.explained.map(({ name, what, how }, i) => (
              <div key={name}>
                {i > 0 && <h4>{name}</h4>}
                <p>{what}</p>
                <p className="quiet">{how}</p>
              </div>
            ))}
          </div>
          <button
            type="button"
            className="text-button"
            data-testid="all-explained"
            onClick={() => {
              setAsked(null);
              setAll(true);
            }}
          >
            {text.allExplained}
          </button>
        </div>
      )}
      {all && catalogue !== null && (
        <Glossary catalogue={catalogue} twin={twin} onClose={() => setAll(false)} />
      )}
    </>
  );
}

/** Below the element if there is more room than above, and within the window. */
function besideStyle({ left, top, bottom }: Asked['at']): CSSProperties {
  const most = window.innerWidth - Math.min(WIDTH_PX, window.innerWidth - 2 * EDGE_PX) - EDGE_PX;
  const at = { left: Math.max(EDGE_PX, Math.min(left, most)) };
  const below = window.innerHeight - bottom;
  return below >= top
    ? { ...at, top: bottom + GAP_PX, maxHeight: below - GAP_PX - EDGE_PX }
    : { ...at, bottom: window.innerHeight - top + GAP_PX, maxHeight: top - GAP_PX - EDGE_PX };
}

/** A dialog with everything that the page explains, and with the flags of this robot. */
function Glossary(props: { catalogue: Catalogue; twin: RobotTwin; onClose: () => void }) {
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
