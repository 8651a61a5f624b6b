import { isolated, plainName } from '../../twin/names.ts';
import { useNow } from '../shell/now.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { selectJoint, useSelectedJoint } from '../state/selection.ts';
import { useSettings } from '../state/settings.ts';
import { languageTag } from '../text/language.ts';
import { useMore } from '../text/more.ts';
import { Cross } from './Cross.tsx';
import { readingWords } from './reading_words.ts';

/** Additional values; the position is above them. */
const ALSO = [
  ['ref', 'reference'],
  ['vel', 'velocity'],
  ['effort', 'torque'],
  ['cur', 'current'],
  ['temp', 'heat'],
] as const;
/** Numbers that change faster can't be read. */
const EVERY_MS = 250;

/** The selected joint, large: its name, its position and its other readings. Empty if none is selected. */
export function ChosenJoint({ link }: { link: RobotLink }) {
  useNow(EVERY_MS);
  const joint = useSelectedJoint();
  const { angle } = useSettings();
  const text = useMore();
  if (joint === null) return null;
  const { twin } = link;
  const plain = plainName(twin.schema, joint, languageTag());
  return (
    <section className="present-joint" aria-label={isolated(joint)} data-testid="present-joint">
      <h3>
        {isolated(joint)} {plain !== undefined && <span>{plain}</span>}
        <Cross what={text.closeCard} onPress={() => selectJoint(null)} />
      </h3>
      <p className="present-value">{readingWords(twin, 'pos', joint, angle)}</p>
      <dl>
        {ALSO.map(([name, word]) => {
          const value = readingWords(twin, name, joint, angle);
          return (
            value !== null && (
              <div key={name}>
                <dt>{text[word]}</dt>
                <dd>{value}</dd>
              </div>
            )
          );
        })}
      </dl>
    </section>
  );
}
