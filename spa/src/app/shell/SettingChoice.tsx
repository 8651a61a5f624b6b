import { changeSettings, type Settings, useSettings } from '../state/settings.ts';

/** A value of a setting, its label, and a tooltip if the label does not explain it. */
type Value<Name extends keyof Settings> = readonly [value: Settings[Name], words: string, title?: string];

/** Radio buttons for the values of one setting. Choosing one changes the setting. */
export function SettingChoice<Name extends keyof Settings>(props: {
  name: Name;
  values: readonly Value<Name>[];
}) {
  const chosen = useSettings()[props.name];
  return props.values.map(([value, words, title]) => (
    <label key={String(value)}>
      <input
        type="radio"
        name={props.name}
        checked={chosen === value}
        onChange={() => changeSettings({ [props.name]: value })}
      />
      <span title={title}>{words}</span>
    </label>
  ));
}
