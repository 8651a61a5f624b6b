import '../shell/styles/choices.css';
import '../shell/styles/signs.css';
import { Balance } from '../../scene/signs/balance.ts';
import { Load } from '../../scene/signs/load.ts';
import { isSwitchedOn, switched } from '../../scene/signs/sign.ts';
import { SIGNS } from '../../scene/signs/signs.ts';
import { type Lack, lacksOf } from '../../twin/balance/lacks.ts';
import { isolated } from '../../twin/names.ts';
import { BALANCE } from '../balance/BalanceParts.tsx';
import { useLatePart } from '../shell/late.tsx';
import { usePopover } from '../shell/page_keys.ts';
import { SettingChoice } from '../shell/SettingChoice.tsx';
import { useTicked } from '../state/hooks.ts';
import { type RobotLink, useVersion } from '../state/robot_link.ts';
import { changeSettings, useSettings } from '../state/settings.ts';
import { languageTag, useMore } from '../text/language.ts';
import { type BalanceText, useBalanceText } from '../text/late.ts';

/** The interval between checks for data that is not available yet. */
const EVERY_MS = 250;

/** The button and menu for choosing what is drawn on the body. It offers only what at least one of the robots can show, and is empty
 *  if there is nothing to offer. `drawsBalance`: see `BodyView`. */
export function SignMenu({ links, drawsBalance }: { links: readonly RobotLink[]; drawsBalance: boolean }) {
  const { open, setOpen, around } = usePopover<HTMLFieldSetElement>();
  const settings = useSettings();
  useVersion(...links);
  const text = useMore();
  const offered = SIGNS.filter((kind) =>
    links.some(
      ({ twin: { schema, modelHash } }) =>
        schema !== null && kind.can(schema) && (kind !== Balance || modelHash !== null),
    ),
  );
  if (offered.length === 0) return null;
  return (
    <fieldset className="segments signs" ref={around} data-testid="signs">
      <legend className="unseen">{text.signs}</legend>
      <button
        type="button"
        title={text.signsAtBody}
        aria-expanded={open}
        onClick={() => setOpen(!open)}
        data-on={settings.load !== 'off'}
      >
        {text.signs.toLowerCase()}
      </button>
      {open && (
        <div className="sign-menu" data-testid="sign-menu">
          {offered.map((kind) => {
            if (kind === Balance) return <BalanceEntry key={kind.key} links={links} isDrawn={drawsBalance} />;
            if (kind === Load) return <LoadEntry key={kind.key} links={links} />;
            return (
              kind.menu && (
                <Switch
                  key={kind.key}
                  {...(kind.menu.explain === undefined ? {} : { explain: kind.menu.explain })}
                  on={isSwitchedOn(kind, settings)}
                  onChange={(on) => changeSettings(switched(kind, on, settings))}
                  text={kind.menu.name[languageTag()]}
                />
              )
            );
          })}
          <button type="button" className="text-button" data-explain="all" aria-haspopup="dialog">
            {text.allExplained}
          </button>
        </div>
      )}
    </fieldset>
  );
}

/** A labelled check box in the style of a switch. `explain`: the key of its explanation, if it has one. */
function Switch(props: { on: boolean; onChange: (on: boolean) => void; text: string; explain?: string }) {
  const { on, onChange, text, explain } = props;
  const rest = useMore();
  return (
    <label className="switch">
      <span>{text}</span>
      {explain !== undefined && (
        <button
          type="button"
          className="explain-mark"
          data-explain={explain}
          aria-haspopup="dialog"
          aria-label={rest.explainIt(text)}
        >
          ?
        </button>
      )}
      <input type="checkbox" checked={on} onChange={(e) => onChange(e.target.checked)} />
    </label>
  );
}

/** The choice of the load that colours the body. */
function LoadEntry({ links }: { links: readonly RobotLink[] }) {
  const text = useMore();
  const words = { off: text.loadOff, cur: text.loadCurrent, temp: text.loadHeat };
  const found = links.flatMap(({ twin: { schema } }) => (schema === null ? [] : Load.fieldsOf(schema)));
  const fields = (['off', 'cur', 'temp'] as const).filter((one) => one === 'off' || found.includes(one));
  return (
    <fieldset className="choice">
      <legend>{text.coloursOfBody}</legend>
      <div className="segments">
        <SettingChoice name="load" values={fields.map((field) => [field, words[field]] as const)} />
      </div>
    </fieldset>
  );
}

/** The menu entry for balance: a switch if at least one of the robots has balance data, and one line for each part that is
 *  unavailable, with the reason. `isDrawn`: whether the view of the body draws its signs. */
function BalanceEntry({ links, isDrawn }: { links: readonly RobotLink[]; isDrawn: boolean }) {
  const text = useBalanceText();
  const part = useLatePart(BALANCE);
  const shown = useTicked(EVERY_MS, () => {
    if (part === null) return null;
    const watches = links.map((link) => ({ name: link.twin.name, watch: part.balanceOf(link) }));
    const known = watches.flatMap(({ name, watch }) => {
      const found = watch.known();
      return found === null ? [] : [{ name, ...found }];
    });
    if (known.length === 0) return null;
    const lines = known.flatMap(({ name, balance, findings, problems }) =>
      lacksOf(balance, findings, problems).map((lack) =>
        [links.length > 1 ? `${name}: ` : '', lackWords(lack, text)].join(''),
      ),
    );
    const isPossible = known.some(({ possible }) => possible);
    if (isPossible && !isDrawn) lines.unshift(text.onlyIn3d);
    return {
      lines,
      isPossible,
      byItself: watches.some(({ watch }) => watch.isShownByItself),
      isOn: watches.some(({ watch }) => watch.isShown),
    };
  });
  if (shown === null) return null;
  const { lines, isPossible, byItself, isOn } = shown;
  return (
    <div className="sign-entry" data-testid="balance-entry">
      {isPossible ? (
        <Switch
          explain="balance.balance"
          on={isOn}
          onChange={(on) => changeSettings({ balance: on === byItself ? 'auto' : on ? 'on' : 'off' })}
          text={text.balance}
        />
      ) : (
        <span>{text.balance}</span>
      )}
      {lines.map((line) => (
        <p className="quiet" key={line}>
          {line}
        </p>
      ))}
    </div>
  );
}

const WHY = {
  raw: 'rawModel',
  unreadable: 'builtBefore',
  'old-bundle': 'builtBefore',
  'no-masses': 'noMasses',
  'impossible-masses': 'impossibleMasses',
  'no-feet': 'noFeet',
  'no-wrench': 'noForce',
  'no-pressure': 'noPressure',
  'orientation-unread': 'orientationUnread',
  'joint-unread': 'jointUnread',
} as const;

/** Why a part of balance is unknown, in one line. */
export function lackWords({ why, told }: Lack, text: BalanceText): string {
  return told === undefined ? text[WHY[why]] : isolated(told);
}
