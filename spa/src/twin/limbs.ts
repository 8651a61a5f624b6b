import type { Schema } from '@posecast/wire';
import { JointChannels, type KinematicTree } from './kinematic_tree.ts';
import { isolated } from './names.ts';

/** A group of joints that belong together, with its title; labels are the robot's own. */
export interface Limb {
  readonly title: string;
  readonly labels: readonly string[];
}

/** A branch with fewer channels does not count as a limb: a finger stays with its arm. */
const LEAST_CHANNELS = 3;
/** Prefix of keys made from names; alone it is the key of joints with meaningless names. No joint name starts with it. */
const UNNAMED = '\n';

/** The names of limbs in the viewer's language. */
export interface LimbWords {
  readonly limbLeft: string;
  readonly limbRight: string;
  readonly leg: string;
  readonly arm: string;
  readonly hand: string;
  readonly head: string;
  readonly trunk: string;
  readonly otherJoints: string;
  readonly sideAndPart: (side: string, part: string) => string;
}

const SIDES = { left: 'limbLeft', right: 'limbRight' } as const;
type Side = keyof typeof SIDES;
type Part = 'leg' | 'arm' | 'hand' | 'head' | 'trunk';
const PARTS: readonly (readonly [part: Part, words: RegExp])[] = [
  ['leg', /\b(hip|thigh|knee|shin|ankle|foot|leg|toe)\b/],
  ['arm', /\b(shoulder|elbow|forearm|wrist|hand|arm)\b/],
  ['hand', /\b(finger|thumb|index|middle|ring|little|pinky|gripper)\b/],
  ['head', /\b(head|neck|eye|jaw)\b/],
  ['trunk', /\b(waist|torso|trunk|spine|chest)\b/],
];

/**
 * Groups the joints into limbs, each in the robot's order. With a model, the kinematic tree is cut where two long branches split;
 * without one (`tree` null), joints are grouped by words in their names.
 */
export function limbsOf(schema: Schema, tree: KinematicTree | null, called: LimbWords): Limb[] {
  const labels = (schema.field('pos') ?? schema.field('ref'))?.labels ?? [];
  const words = new Map(labels.map((label) => [label, wordsOf(label, schema.mapping.names.get(label))]));
  const sideOf = sidesOf(labels, words);
  const branch = tree === null ? null : branchesOf(schema, labels, tree);
  const groups = new Map<string, string[]>();
  for (const label of labels) {
    const key = branch?.get(label) ?? UNNAMED + (nameOf([label], words, sideOf, called) ?? '');
    put(groups, key, label);
  }
  return [...groups].map(([key, members]) => ({
    title: nameOf(members, words, sideOf, called) ?? (key === UNNAMED ? called.otherJoints : spanOf(members)),
    labels: members,
  }));
}

/** Channel → the joint at which its branch begins. */
function branchesOf(schema: Schema, labels: readonly string[], tree: KinematicTree): Map<string, string> {
  const mapping = new JointChannels(schema);
  const moving = new Map<string, string[]>(); // joint → channels
  for (const label of labels) {
    for (const joint of mapping.jointsOf(label)) put(moving, joint, label);
  }
  const after = new Map<string | null, string[]>();
  for (const joint of tree.joints) {
    put(after, tree.before(joint), joint);
  }
  // Up to LEAST_CHANNELS of the channels that move a joint and all joints after it, collected from the tips inwards.
  const beyond = new Map<string, ReadonlySet<string>>();
  for (const joint of tree.joints.toReversed()) {
    const some = new Set<string>();
    for (const label of moving.get(joint) ?? []) if (some.size < LEAST_CHANNELS) some.add(label);
    for (const child of after.get(joint) ?? [])
      for (const label of beyond.get(child) ?? []) if (some.size < LEAST_CHANNELS) some.add(label);
    beyond.set(joint, some);
  }
  const found = new Map<string, string>();
  const walk = (joint: string, start: string) => {
    for (const label of moving.get(joint) ?? []) if (!found.has(label)) found.set(label, start);
    const next = after.get(joint) ?? [];
    const parts = next.filter((child) => beyond.get(child)!.size >= LEAST_CHANNELS).length > 1;
    for (const child of next) walk(child, parts ? child : start);
  };
  for (const joint of after.get(null) ?? []) walk(joint, joint);
  return found;
}

function put<K>(into: Map<K, string[]>, key: K, value: string): void {
  const values = into.get(key) ?? [];
  values.push(value);
  into.set(key, values);
}

/** "left_hip_pitch_joint" → "left hip pitch joint", with the plain name in front if there is one. */
function wordsOf(label: string, plain: string | undefined): string {
  return `${plain ?? ''} ${label.replace(/([a-z])([A-Z])/g, '$1 $2').replace(/[_\-.]/g, ' ')}`.toLowerCase();
}

/** The side of each joint: the word left or right in its name, or a first letter L or R that has a counterpart (LKN,
 *  RKN). */
function sidesOf(
  labels: readonly string[],
  words: ReadonlyMap<string, string>,
): ReadonlyMap<string, Side | null> {
  const all = new Set(labels);
  const other: Readonly<Record<string, string>> = { L: 'R', R: 'L', l: 'r', r: 'l' };
  return new Map(
    labels.map((label) => {
      const said = /\b(left|right)\b/.exec(words.get(label) ?? '')?.[1] as Side | undefined;
      if (said !== undefined) return [label, said];
      const [first = ''] = label;
      const mirrored = (other[first] ?? '') + label.slice(1);
      if (other[first] === undefined || !all.has(mirrored)) return [label, null];
      return [label, first.toLowerCase() === 'l' ? 'left' : 'right'];
    }),
  );
}

/** A title such as "Left arm", from the names of most joints; null if their names don't tell. */
function nameOf(
  labels: readonly string[],
  words: ReadonlyMap<string, string>,
  sideOf: ReadonlyMap<string, Side | null>,
  called: LimbWords,
): string | null {
  const part = most(
    labels.map((label) => PARTS.find(([, pattern]) => pattern.test(words.get(label) ?? ''))?.[0] ?? null),
  );
  const side =
    part === 'head' || part === 'trunk' ? null : most(labels.map((label) => sideOf.get(label) ?? null));
  if (side === null) return part === null ? null : capital(called[part]);
  const named = called[SIDES[side]];
  return part === null ? named : called.sideAndPart(named, called[part]);
}

/** The value that more than half of the entries have; null if there is none. */
function most<T extends string>(said: readonly (T | null)[]): T | null {
  const counts = new Map<T, number>();
  for (const one of said) if (one !== null) counts.set(one, (counts.get(one) ?? 0) + 1);
  const [best] = [...counts].sort((a, b) => b[1] - a[1]);
  return best !== undefined && best[1] * 2 > said.length ? best[0] : null;
}

function spanOf(labels: readonly string[]): string {
  const [first = '', last = first] = [labels[0], labels.at(-1)];
  return first === last ? isolated(first) : `${isolated(first)} to ${isolated(last)}`;
}

function capital(word: string): string {
  return word.slice(0, 1).toUpperCase() + word.slice(1);
}
