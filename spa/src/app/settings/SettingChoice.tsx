import { changeSettings, type Settings, useSettings } from '../state/settings.ts';

/** A value of a setting, what it is called, and what it means where the name does not say it. */
type Value<Name extends keyof Settings> = readonly [value: Settings[Name], words: string, title?: string];

/** One setting as a row of values, of which one is chosen. */
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
