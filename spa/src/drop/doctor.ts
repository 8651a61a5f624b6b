/** What is wrong with a URDF, in plain words. The edge's `posecast-edge doctor` says more; this says the main things. */
export interface Diagnosis {
  readonly severity: 'error' | 'warning' | 'hint';
  readonly text: string;
}

/** A joint that a slider can move. */
export interface Joint {
  readonly name: string;
  readonly unit: 'rad' | 'm';
  readonly lower: number;
  readonly upper: number;
}

const TYPES = new Set(['revolute', 'continuous', 'prismatic', 'fixed', 'floating', 'planar']);
const RANK = { error: 0, warning: 1, hint: 2 } as const;
const FULL_TURN = 2 * Math.PI;
const MAX_DIAGNOSES = 200;

/** Worst first, each once, at most 200. */
export function diagnose(robot: Element, missing: readonly string[], text: string): Diagnosis[] {
  const found: Diagnosis[] = [];
  const say = (severity: Diagnosis['severity'], words: string) => {
    found.push({ severity, text: words });
  };
  tree(robot, say);
  for (const joint of children(robot, 'joint')) {
    examineAxis(joint, say);
    examineLimit(joint, say);
  }
  mimics(robot, say);
  for (const uri of missing) say('warning', `The mesh ${uri} is not among the files.`);
  if (/\$\{|<xacro:/.test(text)) say('error', 'This is a xacro template: run xacro on it first.');
  for (const origin of robot.querySelectorAll('joint > origin')) {
    const far = Math.max(...numbers(origin.getAttribute('xyz')).map(Math.abs), 0);
    if (far <= 20) continue;
    const name = nameOf(origin.parentElement!);
    say('warning', `Joint ${name} is ${far.toFixed(0)} m from its parent: millimetres taken for metres?`);
  }
  const once = [...new Map(found.map((diagnosis) => [diagnosis.text, diagnosis])).values()];
  return once.sort((a, b) => RANK[a.severity] - RANK[b.severity]).slice(0, MAX_DIAGNOSES);
}

/** What sliders show: every joint that moves by itself. */
export function readJoints(robot: Element): Joint[] {
  return children(robot, 'joint').flatMap((joint) => {
    const type = joint.getAttribute('type');
    if (children(joint, 'mimic').length > 0) return [];
    if (type !== 'revolute' && type !== 'continuous' && type !== 'prismatic') return [];
    const [lower, upper] = limits(joint);
    const sound = type !== 'continuous' && lower !== null && upper !== null && lower < upper;
    const reach = type === 'prismatic' ? 1 : Math.PI;
    return [
      {
        name: nameOf(joint),
        unit: type === 'prismatic' ? 'm' : 'rad',
        lower: sound ? Math.min(lower, 0) : -reach,
        upper: sound ? Math.max(upper, 0) : reach,
      } as const,
    ];
  });
}

type Say = (severity: Diagnosis['severity'], text: string) => void;

function tree(robot: Element, say: Say): void {
  const links = new Set<string>();
  for (const link of children(robot, 'link')) {
    const name = nameOf(link);
    if (name === '') say('error', 'A link has no name.');
    else if (links.has(name)) say('error', `Two links are called ${name}.`);
    links.add(name);
  }
  if (links.size === 0) {
    say('error', 'There are no links.');
    return;
  }
  const parentOf = new Map<string, string>();
  const jointNames = new Set<string>();
  for (const joint of children(robot, 'joint')) {
    const name = nameOf(joint);
    if (jointNames.has(name)) say('error', `Two joints are called ${name}.`);
    jointNames.add(name);
    const type = joint.getAttribute('type') ?? '';
    if (!TYPES.has(type)) say('error', `Joint ${name} is of type "${type}", which URDF does not know.`);
    const ends = ['parent', 'child'].map((end) => children(joint, end)[0]?.getAttribute('link') ?? '');
    for (const end of ends)
      if (!links.has(end)) say('error', `Joint ${name} names the link "${end}", which does not exist.`);
    const [parent = '', child = ''] = ends;
    if (parentOf.has(child)) say('error', `Link ${child} has two parents.`);
    else parentOf.set(child, parent);
  }
  const roots = [...links].filter((link) => !parentOf.has(link));
  if (roots.length === 0) say('error', 'There is no root link: the joints form a circle.');
  if (roots.length > 1) say('warning', `There are ${roots.length} roots: ${roots.slice(0, 4).join(', ')}.`);
}

function examineAxis(joint: Element, say: Say): void {
  const axis = children(joint, 'axis')[0];
  if (axis === undefined || joint.getAttribute('type') === 'fixed') return;
  const parts = numbers(axis.getAttribute('xyz'));
  const length = Math.hypot(...parts);
  if (parts.length !== 3 || !Number.isFinite(length))
    say('error', `The axis of joint ${nameOf(joint)} is not three numbers.`);
  else if (length === 0) say('error', `The axis of joint ${nameOf(joint)} is zero: it can't move.`);
  else if (Math.abs(length - 1) > 1e-3) {
    say(
      'hint',
      `The axis of joint ${nameOf(joint)} has length ${length.toFixed(3)}, not 1; it is taken as a direction.`,
    );
  }
}

function examineLimit(joint: Element, say: Say): void {
  const type = joint.getAttribute('type');
  const name = nameOf(joint);
  if (type !== 'revolute' && type !== 'prismatic') return;
  const [lower, upper] = limits(joint);
  if (lower === null || upper === null) {
    if (children(joint, 'limit').length === 0) say('warning', `Joint ${name} is ${type} and has no limits.`);
    return;
  }
  if (lower > upper) say('error', `Joint ${name}: its lower limit ${lower} is above its upper ${upper}.`);
  else if (lower === upper) say('warning', `Joint ${name}: its limits are equal, it can't move.`);
  else if (lower > 0 || upper < 0) say('hint', `Joint ${name}: its limits (${lower} to ${upper}) exclude 0.`);
  if (type === 'revolute' && Math.max(Math.abs(lower), Math.abs(upper)) > 2 * FULL_TURN) {
    say('warning', `Joint ${name}: limits of ${lower} to ${upper} rad look like degrees.`);
  }
}

function mimics(robot: Element, say: Say): void {
  const joints = children(robot, 'joint');
  const names = new Set(joints.map(nameOf));
  const leaderOf = new Map<string, string>();
  for (const joint of joints) {
    const leader = children(joint, 'mimic')[0]?.getAttribute('joint');
    if (leader == null) continue;
    if (!names.has(leader)) say('error', `Joint ${nameOf(joint)} mimics "${leader}", which does not exist.`);
    leaderOf.set(nameOf(joint), leader);
  }
  for (const start of leaderOf.keys()) {
    let at = leaderOf.get(start);
    for (let steps = 0; at !== undefined && at !== start && steps < leaderOf.size; steps += 1)
      at = leaderOf.get(at);
    if (at === start) say('error', `Joint ${start} mimics itself in a circle.`);
  }
}

function limits(joint: Element): [lower: number | null, upper: number | null] {
  const limit = children(joint, 'limit')[0];
  const number = (key: string) => {
    const text = limit?.getAttribute(key);
    const value = text == null ? (limit === undefined ? Number.NaN : 0) : Number(text);
    return Number.isFinite(value) ? value : null;
  };
  return [number('lower'), number('upper')];
}

function numbers(text: string | null): number[] {
  return (text ?? '').trim().split(/\s+/).filter(Boolean).map(Number);
}

function children(element: Element, name: string): Element[] {
  return [...element.children].filter((child) => child.nodeName === name);
}

function nameOf(element: Element): string {
  return element.getAttribute('name') ?? '';
}
