import { useEffect, useState } from 'react';
import { korean, useText } from '../text/language.ts';
import type english from './en.json';

/** What is said of one thing: a sentence for someone who has never seen a robot, and how it is measured. The docs' tables
 *  are made of the same (`tools/explained.py`). */
export interface Explained {
  readonly name: string;
  readonly what: string;
  readonly how: string;
}

/** The kinds of things that are explained, in the order in which they are listed. */
export const SECTIONS = [
  'words',
  'columns',
  'signs',
  'sensors',
  'units',
] as const satisfies readonly Section[];
export type Section = keyof typeof english;
export type Catalogue = Readonly<Record<Section, Readonly<Record<string, Explained>>>>;

/** Loads the catalogue in the language in force. */
async function loadCatalogue(): Promise<Catalogue> {
  const found = korean() === null ? await import('./en.json') : await import('./ko.json');
  return found.default;
}

/** The catalogue in the language in force; null until it is loaded, and where it can't be. */
export function useCatalogue(): Catalogue | null {
  const text = useText();
  const [catalogue, setCatalogue] = useState<Catalogue | null>(null);
  // biome-ignore lint/correctness/useExhaustiveDependencies: the text changes with the language
  useEffect(() => {
    let left = false;
    loadCatalogue().then(
      (found) => !left && setCatalogue(found),
      () => {},
    );
    return () => {
      left = true;
    };
  }, [text]);
  return catalogue;
}

/** What a key such as `columns.pos` names; null if there is no such thing. */
export function explainedBy(catalogue: Catalogue, key: string): Explained | null {
  const dot = key.indexOf('.');
  const section = SECTIONS.find((name) => name === key.slice(0, dot));
  const entries = section === undefined ? null : catalogue[section];
  const name = key.slice(dot + 1);
  return entries !== null && Object.hasOwn(entries, name) ? entries[name]! : null;
}
