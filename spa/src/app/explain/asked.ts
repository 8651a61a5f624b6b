import { fillSentence } from '../../twin/alarms/sentence.ts';
import { flagWords } from '../../twin/format.ts';
import { isolated } from '../../twin/names.ts';
import { wordsOfName } from '../../twin/plain_names.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { more } from '../text/more.ts';
import { type Catalogue, type Explained, explainedBy } from './catalogue.ts';
import { flagSentence } from './flag_sentence.ts';

/** What somebody asked about: the element that was pressed, and the things that explain it, the first of them itself. */
export interface Asked {
  readonly by: HTMLElement;
  readonly explained: readonly Explained[];
}

/** How far a pointer may have moved between press and release, CSS px, to be a tap. */
const TAP_PX = 6;

/** The explanation of an element with `data-explain`, and of the units that stand beside it. */
export function explain(by: HTMLElement, catalogue: Catalogue, twin: RobotTwin): readonly Explained[] {
  const { explain: key = '', source = '', bit = '' } = by.dataset;
  if (key === 'flag') return [explainFlag(catalogue, twin, source, bit)];
  if (key === 'units') return [explainUnit(catalogue, by.textContent)];
  const beside = [...(by.closest('th, table')?.querySelectorAll('[data-explain="units"]') ?? [])];
  const units = [...new Set(beside.map(({ textContent }) => textContent))].filter((unit) => unit !== '');
  const found = explainedBy(catalogue, key);
  return [...(found === null ? [] : [found]), ...units.map((unit) => explainUnit(catalogue, unit))];
}

/** The label on the body under a tap, if there is one. It lets pointers through, so that it can't be in the camera's way. */
export function labelUnder(press: { x: number; y: number }, release: MouseEvent): HTMLElement | null {
  const { clientX: x, clientY: y } = release;
  if (Math.hypot(x - press.x, y - press.y) > TAP_PX) return null;
  for (const label of document.querySelectorAll<HTMLElement>('.sign-label:not([hidden])')) {
    const { left, right, top, bottom } = label.getBoundingClientRect();
    if (x >= left && x <= right && y >= top && y <= bottom) return label;
  }
  return null;
}

/** The key of what a label on the body says. */
export function keyOfLabel({ dataset }: HTMLElement): string {
  if (dataset.sign?.includes('apart-') !== true) return 'signs.force';
  return dataset.quiet === 'true' ? 'signs.yields' : 'signs.ghost';
}

function explainUnit(catalogue: Catalogue, unit: string): Explained {
  return explainedBy(catalogue, `units.${unit}`) ?? { ...catalogue.sensors.other!, name: unit };
}

/** A flag by the profile's sentences; the others by what a flag is. */
function explainFlag(catalogue: Catalogue, twin: RobotTwin, source: string, bit: string): Explained {
  const name = flagWords(bit);
  const told = flagSentence(twin, source, bit);
  const general = catalogue.words.flag!;
  if (told === null) return { ...general, name };
  const joint = wordsOfName(twin.schema, source) ?? source;
  const said = fillSentence(told.say, (place) => (place === 'joint' ? joint : null));
  const what = said.startsWith(joint) ? joint[0]!.toUpperCase() + said.slice(1) : said;
  return { name, what: isolated(what), how: isolated(told.why ?? '') };
}

/** The joints' flags that the robot's profile explains. */
export function explainFlags(twin: RobotTwin): (readonly [bit: string, explained: Explained])[] {
  const { flagOf } = more();
  return (twin.schema?.field('flags')?.bits ?? []).flatMap((bit) => {
    const [source = ''] = twin.schema?.field('flags')?.labels ?? [];
    const told = flagSentence(twin, source, bit);
    if (told === null) return [];
    const said = fillSentence(told.say, (place) => (place === 'joint' ? flagOf : null));
    return [[bit, { name: flagWords(bit), what: isolated(said), how: isolated(told.why ?? '') }] as const];
  });
}
