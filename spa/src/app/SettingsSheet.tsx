import { useEffect, useRef } from 'react';
import { CloseIcon } from './icons.tsx';
import { changeSettings, type Settings, useSettings } from './settings.ts';

/** Few, and in one place. */
export function SettingsSheet({ onClose }: { onClose: () => void }) {
  const dialog = useRef<HTMLDialogElement>(null);
  const { theme, angle, faultsFirst } = useSettings();
  useEffect(() => {
    dialog.current?.showModal();
    dialog.current?.focus(); // not the first button: nothing is proposed yet
  }, []);
  return (
    // biome-ignore lint/a11y/useKeyWithClickEvents: Escape closes a dialog by itself
    <dialog
      className="settings"
      ref={dialog}
      tabIndex={-1}
      onClose={onClose}
      onClick={(event) => event.target === dialog.current && dialog.current.close()}
      aria-label="Settings"
      data-testid="settings"
    >
      <div className="settings-inner">
        <header>
          <h2>Settings</h2>
          <button
            type="button"
            className="icon-button"
            aria-label="Close"
            onClick={() => dialog.current?.close()}
          >
            <CloseIcon />
          </button>
        </header>
        <Choice<Settings['theme']>
          name="theme"
          legend="Theme"
          chosen={theme}
          choices={[
            ['system', 'System'],
            ['dark', 'Dark'],
            ['light', 'Light'],
          ]}
          onChoose={(chosen) => changeSettings({ theme: chosen })}
        />
        <Choice<Settings['angle']>
          name="angle"
          legend="Angles"
          chosen={angle}
          choices={[
            ['rad', 'rad'],
            ['deg', 'degrees'],
          ]}
          onChoose={(chosen) => changeSettings({ angle: chosen })}
        />
        <Choice<'faults' | 'robot'>
          name="order"
          legend="Order of joints"
          chosen={faultsFirst ? 'faults' : 'robot'}
          choices={[
            ['faults', 'Faults first'],
            ['robot', 'As the robot has them'],
          ]}
          onChoose={(chosen) => changeSettings({ faultsFirst: chosen === 'faults' })}
        />
        <p className="quiet">Kept in this browser only.</p>
      </div>
    </dialog>
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
