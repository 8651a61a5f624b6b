import { LatePart } from '../../browser/late_part.ts';
import { useLatePart } from '../shell/late.tsx';
import { korean, useText } from '../text/language.ts';
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
