/** Reads the part `balance` of a schema's `mapping`: what the robot stands on. Apart from the rest, for few pages need it. */

import { entries, fail, items, parseJson, table, texts } from './checked.ts';
import type { Schema, Xyz } from './schema.ts';
import { xyz } from './schema_parser.ts';

const FEET_MAX = 16;
const CORNERS_MAX = 64; // of a sole
const GROUNDS = ['measured', 'lowest'] as const;

export type Ground = (typeof GROUNDS)[number];

/** What is null or missing here the model and the sensors say (docs/reference/model-bundle.md). */
export interface BalanceRule {
  /** Sites of wrench sensors, or links; none: it stands on nothing that is known. */
  readonly feet: readonly string[] | null;
  /** Which feet bear: those whose wrench says so, or the lowest. */
  readonly ground: Ground | null;
  /** The corners of a foot's sole, in its link, m; by its name in `feet`. */
  readonly soles: ReadonlyMap<string, readonly Xyz[]>;
}

/** The rule of a schema; without a part `balance`, one that says nothing. SchemaError names what and where. */
export function readBalance({ text }: Schema): BalanceRule {
  const where = 'mapping.balance';
  const mapping = table(table(parseJson(text), 'schema').get('mapping'), 'mapping');
  const doc = table(mapping.get('balance'), where);
  const given = doc.get('feet') ?? null;
  const feet = given === null ? null : texts(given, `${where}.feet`, FEET_MAX);
  const ground = doc.get('ground') ?? null;
  const known = GROUNDS.find((one) => one === ground) ?? null;
  if (known !== ground) fail(`${where}.ground`, `must be one of ${GROUNDS.join(', ')}`);
  if (table(doc.get('soles'), `${where}.soles`).size > FEET_MAX)
    fail(`${where}.soles`, `more than ${FEET_MAX} soles`);
  return { feet, ground: known, soles: entries(doc.get('soles'), `${where}.soles`, sole) };
}

function sole(value: unknown, where: string): Xyz[] {
  const corners = items(value, where);
  if (corners.length < 3 || corners.length > CORNERS_MAX)
    fail(where, `must have 3 to ${CORNERS_MAX} corners`);
  return corners.map((corner, i) => xyz(corner, `${where}[${i}]`));
}
