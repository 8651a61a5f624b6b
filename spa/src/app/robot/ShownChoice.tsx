import { SettingChoice } from '../shell/SettingChoice.tsx';
import { useMore } from '../text/more.ts';

/** The choice of the joint values that a body shows: pos, ref or both. */
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
