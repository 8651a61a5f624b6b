import { LatePart } from '../../browser/late_part.ts';
import { fillSentence, sentenceOf } from '../../twin/alarms/sentence.ts';
import { flagWords } from '../../twin/format.ts';
import { isolated, wordsOfName } from '../../twin/names.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { useLatePart } from '../shell/late.tsx';
import { korean, languageTag, more, useText } from '../text/language.ts';
import type english from './en.json';

/** The explanation of one thing: a sentence for someone who has never seen a robot, and how it is measured. The tables in the
 *  docs are generated from the same data (`tools/explained.py`). */
export interface Explained {
  readonly name: string;
  readonly what: string;
  readonly how: string;
}

/** The kinds of explained things, in display order. */
export const SECTIONS = [
  'words',
  'timeLine',
  'columns',
  'signs',
  'balance',
  'sensors',
  'units',
] as const satisfies readonly Section[];
export type Section = keyof typeof english;
export type Catalogue = Readonly<Record<Section, Readonly<Record<string, Explained>>>>;

const IN_ENGLISH = new LatePart<Catalogue>(async () => (await import('./en.json')).default);
const IN_KOREAN = new LatePart<Catalogue>(async () => (await import('./ko.json')).default);

/** The catalogue in the current language; null until it is loaded. */
export function useCatalogue(): Catalogue | null {
  useText(); // redrawn when the language changes
  return useLatePart(korean() === null ? IN_ENGLISH : IN_KOREAN);
}

/** All entries of the section that a key names; none if it is not a section. */
export function explainedSection(catalogue: Catalogue, key: string): readonly Explained[] {
  const section = SECTIONS.find((name) => name === key);
  return section === undefined ? [] : Object.values(catalogue[section]);
}

/** The entry that a key such as `columns.pos` names; null if it does not exist. */
export function explainedBy(catalogue: Catalogue, key: string): Explained | null {
  const dot = key.indexOf('.');
  const section = SECTIONS.find((name) => name === key.slice(0, dot));
  const entries = section === undefined ? null : catalogue[section];
  const name = key.slice(dot + 1);
  return entries !== null && Object.hasOwn(entries, name) ? entries[name]! : null;
}

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
  const told = sentenceOf(twin.schema, source, bit, languageTag());
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
    const told = sentenceOf(twin.schema, source, bit, languageTag());
    if (told === null) return [];
    const said = fillSentence(told.say, (place) => (place === 'joint' ? flagOf : null));
    return [[bit, { name: flagWords(bit), what: isolated(said), how: isolated(told.why ?? '') }] as const];
  });
}
