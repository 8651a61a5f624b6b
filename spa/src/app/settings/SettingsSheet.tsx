import { Suspense } from 'react';
import { accounts } from '../../relay/relay.ts';
import { CameraKeys } from '../body/controls/CameraKeys.tsx';
import { Dialog } from '../shell/Dialog.tsx';
import { late } from '../shell/late.tsx';
import type { RobotLink } from '../state/robot_link.ts';
import { ARROWS, changeSettings, type Settings, useSettings } from '../state/settings.ts';
import { useText } from '../text/language.ts';
import { useMore } from '../text/more.ts';
import '../styles/choices.css';
import '../styles/signs.css';

/** For those who open the sheet: the page itself starts without. */
const SignIn = late(async () => (await import('../account/SignIn.tsx')).SignIn);
const LimitSettings = late(async () => (await import('./LimitSettings.tsx')).LimitSettings);

/** Few, and in one place. */
export function SettingsSheet({ link, onClose }: { link: RobotLink | null; onClose: () => void }) {
  const {
    theme,
    language,
    angle,
    faultsFirst,
    body,
    smooth,
    palette,
    arrowScale,
    headingLocked,
    follow,
    mouse,
  } = useSettings();
  const text = useText();
  const rest = useMore();
  return (
    <Dialog title={text.settings} testId="settings" onClose={onClose}>
      <Choice<Settings['theme']>
        name="theme"
        legend={rest.theme}
        chosen={theme}
        choices={[
          ['system', rest.system],
          ['dark', rest.dark],
          ['light', rest.light],
        ]}
        onChoose={(chosen) => changeSettings({ theme: chosen })}
      />
      <Choice<Settings['language']>
        name="language"
        legend="Language · 언어"
        chosen={language}
        choices={[
          ['system', rest.system],
          ['en', 'English'],
          ['ko', '한국어'],
        ]}
        onChoose={(chosen) => changeSettings({ language: chosen })}
      />
      <Choice<Settings['angle']>
        name="angle"
        legend={rest.angles}
        chosen={angle}
        choices={[
          ['rad', 'rad'],
          ['deg', rest.degrees],
        ]}
        onChoose={(chosen) => changeSettings({ angle: chosen })}
      />
      <Choice<'faults' | 'robot'>
        name="order"
        legend={rest.orderOfJoints}
        chosen={faultsFirst ? 'faults' : 'robot'}
        choices={[
          ['faults', rest.faultsFirst],
          ['robot', rest.asTheRobotHasThem],
        ]}
        onChoose={(chosen) => changeSettings({ faultsFirst: chosen === 'faults' })}
      />
      <Choice<Settings['body']>
        name="body"
        legend={rest.drawing}
        chosen={body}
        choices={[
          ['auto', rest.byDevice],
          ['3d', '3D'],
          ['light', rest.lightView],
        ]}
        onChoose={(chosen) => changeSettings({ body: chosen })}
      />
      <Choice<'smooth' | 'raw'>
        name="motion"
        legend={rest.motion}
        chosen={smooth ? 'smooth' : 'raw'}
        choices={[
          ['smooth', rest.smooth],
          ['raw', rest.raw],
        ]}
        onChoose={(chosen) => changeSettings({ smooth: chosen === 'smooth' })}
      />
      <Choice<Settings['palette']>
        name="palette"
        legend={rest.colours}
        chosen={palette}
        choices={[
          ['standard', rest.coloursStandard],
          ['safe', rest.coloursSafe],
        ]}
        onChoose={(chosen) => changeSettings({ palette: chosen })}
      />
      <Choice<'free' | 'locked'>
        name="heading"
        legend={rest.heading}
        chosen={headingLocked ? 'locked' : 'free'}
        choices={[
          ['free', rest.headingFree],
          ['locked', rest.headingLocked],
        ]}
        onChoose={(chosen) => changeSettings({ headingLocked: chosen === 'locked' })}
      />
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
      {link !== null && (
        <Suspense fallback={null}>
          <LimitSettings link={link} />
        </Suspense>
      )}
      <Choice<Settings['follow']>
        name="follow"
        legend={rest.follow}
        chosen={follow}
        choices={[
          ['along', rest.followAlong],
          ['turn', rest.followTurn],
          ['stay', rest.followStay],
        ]}
        onChoose={(chosen) => changeSettings({ follow: chosen })}
      />
      <Choice<Settings['mouse']>
        name="mouse"
        legend={rest.mouse}
        chosen={mouse}
        choices={[
          ['orbit', rest.mouseOrbit],
          ['foxglove', rest.mouseFoxglove],
        ]}
        onChoose={(chosen) => changeSettings({ mouse: chosen })}
      />
      <details className="keys">
        <summary>{rest.keysOfTheCamera}</summary>
        <CameraKeys />
      </details>
      {accounts !== null && (
        <Suspense fallback={null}>
          <SignIn />
        </Suspense>
      )}
      <p className="quiet">{rest.keptHere}</p>
    </Dialog>
  );
}

function Choice<T extends string>(props: {
  name: string;
  legend: string;
  chosen: T;
  choices: readonly (readonly [T, string])[];
  onChoose: (chosen: T) => void;
}) {
  return (
    <fieldset className="choice">
      <legend>{props.legend}</legend>
      <div className="segments">
        {props.choices.map(([value, text]) => (
          <label key={value}>
            <input
              type="radio"
              name={props.name}
              checked={props.chosen === value}
              onChange={() => props.onChoose(value)}
            />
            <span>{text}</span>
          </label>
        ))}
      </div>
    </fieldset>
  );
}
