import { accounts, recordingUrl, relayChoice } from '../../relay/relay.ts';
import { Dialog } from '../shell/Dialog.tsx';
import { late } from '../shell/late.tsx';
import { SettingChoice } from '../shell/SettingChoice.tsx';
import type { RobotLink } from '../state/robot_link.ts';
import { ARROWS, changeSettings, type Settings, useSettings } from '../state/settings.ts';
import { useMore, useText } from '../text/language.ts';
import { KeysList } from './KeysSheet.tsx';
import '../shell/styles/choices.css';
import '../shell/styles/signs.css';

/** Loaded when the sheet is opened, so that the page starts without it. */
const SignIn = late(async () => (await import('./SignIn.tsx')).SignIn);
const LimitSettings = late(async () => (await import('./LimitSettings.tsx')).LimitSettings);

/** Where the relay serves the guide; null for a page that reads no relay. */
function guideAddress(): string | null {
  const { base } = relayChoice();
  return base === null || recordingUrl() !== null ? null : new URL('guide/', base).href;
}

/** The dialog with the settings of the page and the limits of a robot; `link` null: no robot is shown. */
export function SettingsSheet({ link, onClose }: { link: RobotLink | null; onClose: () => void }) {
  const { arrowScale } = useSettings();
  const text = useText();
  const rest = useMore();
  const guide = guideAddress();
  const choice = <Name extends keyof Settings>(
    name: Name,
    legend: string,
    ...values: readonly (readonly [Settings[Name], string])[]
  ) => (
    <fieldset className="choice">
      <legend>{legend}</legend>
      <div className="segments">
        <SettingChoice name={name} values={values} />
      </div>
    </fieldset>
  );
  return (
    <Dialog title={text.settings} testId="settings" onClose={onClose}>
      {choice('theme', rest.theme, ['system', rest.system], ['dark', rest.dark], ['light', rest.light])}
      {choice('language', 'Language · 언어', ['system', rest.system], ['en', 'English'], ['ko', '한국어'])}
      {choice('angle', rest.angles, ['rad', 'rad'], ['deg', rest.degrees])}
      {choice('faultsFirst', rest.orderOfJoints, [true, rest.faultsFirst], [false, rest.asTheRobotHasThem])}
      {choice('names', rest.jointNames, ['codes', rest.namesAsCodes], ['words', rest.namesInWords])}
      {choice('body', rest.drawing, ['auto', rest.byDevice], ['3d', '3D'], ['light', rest.lightView])}
      {choice('smooth', rest.motion, [true, rest.smooth], [false, rest.raw])}
      {choice('palette', rest.colours, ['standard', rest.coloursStandard], ['safe', rest.coloursSafe])}
      {choice('headingLocked', rest.heading, [false, rest.headingFree], [true, rest.headingLocked])}
      <label className="choice slider">
        <span>{rest.arrowLength}</span>
        <input
          type="range"
          min={Math.log2(ARROWS.least)}
          max={Math.log2(ARROWS.most)}
          step={0.25}
          value={Math.log2(arrowScale)}
          onChange={(event) => changeSettings({ arrowScale: 2 ** Number(event.target.value) })}
        />
        <output>{arrowScale.toFixed(2)} ×</output>
      </label>
      {link !== null && <LimitSettings link={link} />}
      {choice(
        'follow',
        rest.follow,
        ['along', rest.followAlong],
        ['turn', rest.followTurn],
        ['stay', rest.followStay],
      )}
      {choice('characterKeys', rest.characterKeys, [true, rest.keysOn], [false, rest.keysOff])}
      <details className="keys">
        <summary>{rest.keys}</summary>
        <KeysList />
      </details>
      {accounts !== null && <SignIn />}
      <p className="quiet">{rest.keptHere}</p>
      {guide !== null && (
        <a className="text-button" href={guide} target="_blank" rel="noreferrer" data-testid="guide">
          {rest.guide}
        </a>
      )}
    </Dialog>
  );
}
