import '../shell/styles/choices.css';
import '../shell/styles/signs.css';
import { OverlayReader } from '../../twin/overlay/reader.ts';
import type { LoadField } from '../../twin/sensors/load.ts';
import { usePopover } from '../shell/page_keys.ts';
import { SettingChoice } from '../shell/SettingChoice.tsx';
import { type RobotLink, useVersion } from '../state/robot_link.ts';
import { changeSettings, type Settings, useSettings } from '../state/settings.ts';
import { useMore } from '../text/language.ts';
import { BalanceEntry } from './BalanceEntry.tsx';
import { Switch } from './Switch.tsx';

/** The button and menu for choosing what the overlay shows. It offers only what at least one of the robots can show, and is empty
 *  if there is nothing to offer. `drawsBalance`: see `BodyView`. */
export function OverlayMenu({ links, drawsBalance }: { links: readonly RobotLink[]; drawsBalance: boolean }) {
  const { open, setOpen, around } = usePopover<HTMLFieldSetElement>();
  const { lens, forces, level, load } = useSettings();
  useVersion(...links);
  const can = abilities(links);
  const rest = useMore();
  const all: readonly (readonly [Settings['load'], string])[] = [
    ['off', rest.loadOff],
    ['cur', rest.loadCurrent],
    ['temp', rest.loadHeat],
  ];
  const loads = all.filter(([field]) => field === 'off' || can.loads.includes(field));
  if (!can.forces && !can.level && !can.lens && !can.balance && loads.length === 1) return null;
  return (
    <fieldset className="segments signs" ref={around} data-testid="signs">
      <legend className="unseen">{rest.signs}</legend>
      <button
        type="button"
        title={rest.signsAtBody}
        aria-expanded={open}
        onClick={() => setOpen(!open)}
        data-on={load !== 'off'}
      >
        {rest.signs.toLowerCase()}
      </button>
      {open && (
        <div className="sign-menu" data-testid="sign-menu">
          {can.forces && (
            <Switch
              explain="signs.force"
              on={forces}
              onChange={(on) => changeSettings({ forces: on })}
              text={rest.forces}
            />
          )}
          {can.level && (
            <Switch
              explain="signs.plumb"
              on={level}
              onChange={(on) => changeSettings({ level: on })}
              text={rest.level}
            />
          )}
          {can.lens && (
            <Switch
              explain="signs.ghost"
              on={lens}
              onChange={(on) => changeSettings({ lens: on })}
              text={rest.lens}
            />
          )}
          {can.balance && <BalanceEntry links={links} isDrawn={drawsBalance} />}
          {loads.length > 1 && (
            <fieldset className="choice">
              <legend>{rest.coloursOfBody}</legend>
              <div className="segments">
                <SettingChoice name="load" values={loads} />
              </div>
            </fieldset>
          )}
          <button type="button" className="text-button" data-explain="all" aria-haspopup="dialog">
            {rest.allExplained}
          </button>
        </div>
      )}
    </fieldset>
  );
}

function abilities(links: readonly RobotLink[]) {
  const all = links.flatMap(({ twin }) => (twin.schema === null ? [] : [new OverlayReader(twin.schema).can]));
  return {
    forces: all.some(({ forces }) => forces),
    level: all.some(({ level }) => level),
    lens: all.some(({ lens }) => lens),
    /** Decided by the model, whose details are shown when the menu is open. */
    balance: links.some(({ twin }) => twin.modelHash !== null && twin.schema !== null),
    loads: all.flatMap<LoadField>(({ loads }) => loads),
  };
}
