import { SettingChoice } from '../../settings/SettingChoice.tsx';
import { useMore } from '../../text/more.ts';

/** Which joint values a body shows. */
export function ShownChoice() {
  const text = useMore();
  return (
    <fieldset className="segments">
      <legend className="unseen">{text.whatTheBodyShows}</legend>
      <SettingChoice
        name="shown"
        values={[
          ['pos', text.showPos, text.whereItIs],
          ['ref', text.showRef, text.whereTold],
          ['both', text.showBoth, text.whereBoth],
        ]}
      />
    </fieldset>
  );
}
