import { fillSentence } from '../../twin/alarms/sentence.ts';
import { flagWords } from '../../twin/format.ts';
import { isolated, wordsOfName } from '../../twin/names.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { languageTag } from '../text/language.ts';
import { more } from '../text/more.ts';
import { type Catalogue, type Explained, explainedBy, explainedSection } from './catalogue.ts';
import { flagSentence } from './flag_sentence.ts';

/** What the viewer asked about: the pressed element and the entries that explain it, its own entry first. */
export interface Asked {
  readonly by: HTMLElement;
  /** Where it is in the window, CSS px. */
  readonly at: Pick<DOMRect, 'left' | 'top' | 'bottom'>;
  readonly explained: readonly Explained[];
}

/** Between a tap and the dialog about it, CSS px. */
const GAP_PX = 10;

/** The explanation of an element with `data-explain` (of a whole section if it names one), and of the units beside it. */
export function explain(by: HTMLElement, catalogue: Catalogue, twin: RobotTwin): readonly Explained[] {
  const { explain: key = '', source = '', bit = '' } = by.dataset;
  if (key === 'flag') return [explainFlag(catalogue, twin, source, bit)];
  if (key === 'units') return [explainUnit(catalogue, by.textContent)];
  const section = explainedSection(catalogue, key);
  if (section.length > 0) return section;
  const beside = [...(by.closest('th, table')?.querySelectorAll('[data-explain="units"]') ?? [])];
  const units = [...new Set(beside.map(({ textContent }) => textContent))].filter((unit) => unit !== '');
  const found = explainedBy(catalogue, key);
  return [...(found === null ? [] : [found]), ...units.map((unit) => explainUnit(catalogue, unit))];
}

/** The position of the dialog about a label: beside the label, or beside the tap if the label is hidden. */
export function placeOf(label: HTMLElement, { clientX, clientY }: MouseEvent): Asked['at'] {
  const box = label.getBoundingClientRect();
  if (box.width > 0) return box;
  return { left: clientX, top: clientY - GAP_PX, bottom: clientY + GAP_PX };
}

/** The keys for what a label or the spirit level shows. */
export function keysOfLabel({ dataset }: HTMLElement): readonly string[] {
  return dataset.explains?.split(' ') ?? [];
}

function explainUnit(catalogue: Catalogue, unit: string): Explained {
  return explainedBy(catalogue, `units.${unit}`) ?? { ...catalogue.sensors.other!, name: unit };
}

/** A flag explained by the profile's sentences, or else by what flags are in general. */
function explainFlag(catalogue: Catalogue, twin: RobotTwin, source: string, bit: string): Explained {
  const name = flagWords(bit);
  const told = flagSentence(twin, source, bit);
  const general = catalogue.words.flag!;
  if (told === null) return { ...general, name };
  const joint = wordsOfName(twin.schema, source, languageTag()) ?? source;
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
