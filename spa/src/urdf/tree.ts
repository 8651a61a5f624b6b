import { type Finding, quoted } from './finding.ts';
import { type Joint, type Link, SCALAR_TYPES, type Urdf } from './types.ts';

/** The kinematic tree of a URDF's links and joints (as in posecast_edge.model.urdf.tree). */
export interface Tree {
  /** The root link; null if there is none. */
  readonly root: Link | null;
  /** The joints below the root, each parent before its children. */
  readonly joints: readonly Joint[];
  /** Mimic joints by name, with the joint that each follows. */
  readonly follows: ReadonlyMap<string, Follow>;
  /** Links by name, including unconnected ones; the first of each name. */
  readonly links: ReadonlyMap<string, Link>;
  /** The problems in the tree. */
  readonly findings: readonly Finding[];
}

/** A mimic joint's value is multiplier × the leader's value + offset. Chains are resolved: a leader is never a mimic joint
 *  itself.
 */
export interface Follow {
  readonly leader: Joint;
  readonly multiplier: number;
  /** rad or m. */
  readonly offset: number;
}

export function buildTree(urdf: Urdf): Tree {
  const findings: Finding[] = [];
  const say = (code: string, text: string, line: number | null) =>
    findings.push({ severity: 'error', code, text, line });
  const links = uniqueLinks(urdf, say);
  const below = jointsByParent(urdf, links, say);
  const held = new Set([...below.values()].flat().map(({ child }) => child));
  const trees = new Map(
    [...links.keys()].filter((name) => !held.has(name)).map((name) => [name, walk(name, below)]),
  );
  let root: string | null = null;
  let order: readonly Joint[] = [];
  if (links.size === 0) {
    say('no-links', 'it has no links', null);
  } else if (trees.size === 0) {
    const [first] = links.values();
    say('no-root', 'there is no root link: the joints form a loop', first?.line ?? null);
  } else {
    for (const [name, joints] of trees)
      if (root === null || joints.length > order.length) [root, order] = [name, joints];
    nameTheRest(root ?? '', trees, links, say);
  }
  const follows = followsOf(urdf, order, say);
  return { root: links.get(root ?? '') ?? null, joints: order, follows, links, findings };
}

type Say = (code: string, text: string, line: number | null) => void;

function uniqueLinks(urdf: Urdf, say: Say): Map<string, Link> {
  const links = new Map<string, Link>();
  for (const link of urdf.links) {
    const first = links.get(link.name);
    if (first === undefined) links.set(link.name, link);
    else
      say(
        'link-doubled',
        `link ${quoted(link.name)} is defined twice (first in line ${first.line}); the first is used`,
        link.line,
      );
  }
  return links;
}

function jointsByParent(urdf: Urdf, links: ReadonlyMap<string, Link>, say: Say): Map<string, Joint[]> {
  const below = new Map<string, Joint[]>();
  const names = new Map<string, Joint>();
  const held = new Map<string, Joint>();
  for (const joint of urdf.joints) {
    const what = `joint ${quoted(joint.name)}`;
    const { parent, child } = joint;
    const first = names.get(joint.name);
    const other = held.get(child);
    const problem =
      first !== undefined
        ? ['joint-doubled', `${what} is defined twice (first in line ${first.line})`]
        : parent !== '' && !links.has(parent)
          ? ['joint-parent', `${what}: its parent link ${quoted(parent)} does not exist`]
          : child !== '' && !links.has(child)
            ? ['joint-child', `${what}: its child link ${quoted(child)} does not exist`]
            : parent !== '' && parent === child
              ? ['loop', `${what} joins link ${quoted(parent)} to itself`]
              : other !== undefined
                ? [
                    'two-parents',
                    `link ${quoted(child)} has two parent joints, ${quoted(other.name)} and ${quoted(joint.name)}`,
                  ]
                : null;
    if (first === undefined) names.set(joint.name, joint);
    if (problem !== null) {
      say(problem[0]!, `${problem[1]}; this joint is left out`, joint.line);
    } else if (parent !== '' && child !== '') {
      held.set(child, joint); // the reader has reported a joint without parent or child
      const siblings = below.get(parent) ?? [];
      siblings.push(joint);
      below.set(parent, siblings);
    }
  }
  return below;
}

/** The joints below a link, depth first in file order, so each parent comes before its children. */
function walk(root: string, below: ReadonlyMap<string, readonly Joint[]>): Joint[] {
  const order: Joint[] = [];
  const waiting = [...(below.get(root) ?? [])].reverse();
  for (let joint = waiting.pop(); joint !== undefined; joint = waiting.pop()) {
    order.push(joint);
    waiting.push(...[...(below.get(joint.child) ?? [])].reverse());
  }
  return order;
}

function nameTheRest(
  root: string,
  trees: ReadonlyMap<string, readonly Joint[]>,
  links: ReadonlyMap<string, Link>,
  say: Say,
): void {
  const reached = new Set(trees.keys());
  for (const [other, joints] of trees) {
    for (const { child } of joints) reached.add(child);
    if (other === root) continue;
    const size = joints.length > 0 ? ` with the ${joints.length} below it` : '';
    const text = `link ${quoted(other)}${size} is not connected to the root ${quoted(root)}; not shown`;
    say('several-roots', text, links.get(other)?.line ?? null);
  }
  const lost = [...links.values()].filter(({ name }) => !reached.has(name));
  if (lost.length === 0) return;
  const names = lost.slice(0, 4).map(({ name }) => quoted(name));
  say('loop', `joints form a loop: ${names.join(', ')}; not shown`, lost[0]?.line ?? null);
}

function followsOf(urdf: Urdf, order: readonly Joint[], say: Say): Map<string, Follow> {
  const follows = new Map<string, Follow>();
  const leaders = new Leaders(order, new Set(urdf.joints.map(({ name }) => name)));
  for (const joint of order) {
    if (joint.mimic === null || !SCALAR_TYPES.has(joint.type)) continue; // the doctor reports the others
    const found = leaders.of(joint);
    if ('leader' in found) follows.set(joint.name, found);
    else say(found.code, `joint ${quoted(joint.name)} ${found.text}`, joint.mimic.line);
  }
  return follows;
}

/** Why a mimic joint has no valid leader. */
interface NoLeader {
  readonly code: string;
  readonly text: string;
}

/** Resolves the leader of each mimic joint. Each part of a chain is followed once, even if many joints share it. */
class Leaders {
  readonly #shown: ReadonlyMap<string, Joint>;
  readonly #known: ReadonlySet<string>;
  readonly #found = new Map<string, Follow | NoLeader>();

  /** `known`: the names of all joints, including omitted ones. */
  constructor(order: readonly Joint[], known: ReadonlySet<string>) {
    this.#shown = new Map(order.map((joint) => [joint.name, joint]));
    this.#known = known;
  }

  of(joint: Joint): Follow | NoLeader {
    const chain = new Map<string, Joint>();
    let at = joint;
    let end = this.#end(at);
    while (end === null && !chain.has(at.name)) {
      chain.set(at.name, at);
      const target = at.mimic!.joint;
      const next = this.#shown.get(target);
      if (next === undefined) {
        const why = this.#known.has(target) ? ', which is left out' : ', which does not exist';
        end = { code: 'mimic-unknown', text: `mimics joint ${quoted(target)}${why}` };
      } else {
        at = next;
        end = this.#end(at);
      }
    }
    let inCircle = end === null;
    for (const one of [...chain.values()].reverse()) {
      if (end === null || inCircle) {
        end = { code: 'mimic-loop', text: `mimics in a loop, through ${quoted(one.name)}` };
        inCircle = one !== at; // the cycle closes here; joints before it only lead into it
      } else end = behind(one, end);
      this.#found.set(one.name, end);
    }
    return end!;
  }

  /** The end of a chain at this joint; null if the chain continues. */
  #end(at: Joint): Follow | NoLeader | null {
    if (at.mimic !== null) return this.#found.get(at.name) ?? null;
    if (SCALAR_TYPES.has(at.type)) return { leader: at, multiplier: 1, offset: 0 };
    const lack = at.type === 'fixed' ? 'no value' : 'more than one value';
    const text = `mimics the ${at.type} joint ${quoted(at.name)}, which has ${lack}`;
    return { code: 'mimic-fixed', text };
  }
}

/** Combines a joint's mimic with the already resolved end of its leader's chain. */
function behind({ mimic }: Joint, end: Follow | NoLeader): Follow | NoLeader {
  if (mimic === null || !('leader' in end)) return end;
  const multiplier = mimic.multiplier * end.multiplier;
  const offset = mimic.multiplier * end.offset + mimic.offset;
  if (!Number.isFinite(multiplier) || !Number.isFinite(offset))
    return { code: 'mimic-endless', text: 'mimics another with a multiplier or offset that is not finite' };
  return { leader: end.leader, multiplier, offset };
}
