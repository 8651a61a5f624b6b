/**
 * URDF text → a DOM that urdf-loader reads without throwing and without guessing.
 *
 * The loader trips over what real files hold: two spaces in a tuple (NaN), an axis that is not a unit vector, a
 * joint to a link that is not there (it throws), a `<geometry/>` with nothing in it. Each is set right here, and
 * each leaves one line for the person who has to mend the file.
 */

export class UrdfError extends Error {}

export interface UrdfDocument {
  robot: Element;
  problems: string[];
}

/** Throws UrdfError when nothing can be drawn: not XML, no `<robot>`, no root link. */
export function readUrdf(text: string): UrdfDocument {
  const xml = new DOMParser().parseFromString(text, 'text/xml');
  const wrong = xml.querySelector('parsererror')?.textContent;
  if (wrong !== undefined && wrong !== null) throw new UrdfError(`URDF: ${firstComplaint(wrong)}`);
  const robot = xml.documentElement;
  if (robot?.nodeName !== 'robot') throw new UrdfError('URDF: no <robot> element');
  const problems: string[] = [];
  mendTuples(robot, problems);
  mendMaterials(robot);
  mendVisuals(robot);
  mendTree(robot, problems);
  mendJoints(robot, problems);
  return { robot, problems };
}

/** Chromium and WebKit wrap the parser's words into a page of their own; Firefox starts with them. */
function firstComplaint(text: string): string {
  const line = /error on line \d+[^\n]*/.exec(text)?.[0] ?? text.split('\n')[0] ?? '';
  return line.replace(/Below is a rendering.*/, '').trim();
}

const TUPLES: readonly [tag: string, attribute: string, size: number, fallback: string][] = [
  ['origin', 'xyz', 3, '0 0 0'],
  ['origin', 'rpy', 3, '0 0 0'],
  ['axis', 'xyz', 3, '1 0 0'],
  ['mesh', 'scale', 3, '1 1 1'],
  ['box', 'size', 3, '0 0 0'],
  ['color', 'rgba', 4, '0.8 0.8 0.8 1'],
];

function mendTuples(robot: Element, problems: string[]): void {
  for (const [tag, attribute, size, fallback] of TUPLES) {
    for (const element of robot.querySelectorAll(tag)) {
      const text = element.getAttribute(attribute);
      if (text === null) {
        if (tag === 'axis' || tag === 'color') element.setAttribute(attribute, fallback);
        continue;
      }
      const numbers = text.trim().split(/\s+/).map(Number);
      const good = numbers.length === size && numbers.every(Number.isFinite);
      if (!good) problems.push(`${owner(element)}: <${tag} ${attribute}="${text}"> is not ${size} numbers`);
      element.setAttribute(attribute, good ? numbers.join(' ') : fallback);
    }
  }
}

/** What a complaint names: the joint or link around the element. */
function owner(element: Element): string {
  for (let at: Element | null = element; at !== null; at = at.parentElement) {
    if (at.nodeName === 'joint' || at.nodeName === 'link') return `${at.nodeName} ${nameOf(at)}`;
  }
  return 'robot';
}

/** A material may be defined inside one visual and only named in the others; the loader looks at the top level.
 *  Textures are left out: the bundle of this version carries none. */
function mendMaterials(robot: Element): void {
  for (const texture of [...robot.querySelectorAll('texture')]) texture.remove();
  const top = new Set(childrenNamed(robot, 'material').map(nameOf));
  for (const material of [...robot.querySelectorAll('visual > material')]) {
    const name = nameOf(material);
    if (name === '' || top.has(name) || childrenNamed(material, 'color').length === 0) continue;
    // The definition moves up only when somebody relies on it: Hubo calls every one of its materials "random".
    const users = [...robot.querySelectorAll('visual > material')].filter((other) => nameOf(other) === name);
    if (users.every((other) => childrenNamed(other, 'color').length > 0)) continue;
    top.add(name);
    robot.appendChild(material.cloneNode(true));
  }
}

function mendVisuals(robot: Element): void {
  for (const visual of [...robot.querySelectorAll('visual')]) {
    const shape = childrenNamed(visual, 'geometry')[0]?.children[0];
    if (shape === undefined) visual.remove();
  }
}

/** Leaves one tree: a single root, every joint between two links that exist, one joint into each link. */
function mendTree(robot: Element, problems: string[]): void {
  const links = new Map(childrenNamed(robot, 'link').map((link) => [nameOf(link), link]));
  const parentOf = new Map<string, string>();
  for (const joint of childrenNamed(robot, 'joint')) {
    const parent = childrenNamed(joint, 'parent')[0]?.getAttribute('link') ?? '';
    const child = childrenNamed(joint, 'child')[0]?.getAttribute('link') ?? '';
    const lost = [parent, child].find((name) => !links.has(name));
    const complaint =
      lost !== undefined
        ? `link "${lost}" does not exist`
        : parentOf.has(child)
          ? `link "${child}" has a joint already`
          : null;
    if (complaint === null) {
      parentOf.set(child, parent);
    } else {
      problems.push(`joint ${nameOf(joint)}: ${complaint}; the joint is left out`);
      joint.remove();
    }
  }
  const root = [...links.keys()].find((name) => !parentOf.has(name));
  if (root === undefined) {
    throw new UrdfError(links.size === 0 ? 'URDF: no links' : 'URDF: no root, its links form a circle');
  }
  const reached = (name: string): boolean => {
    let at: string | undefined = name;
    for (let steps = 0; at !== undefined && steps <= links.size; steps += 1) {
      if (at === root) return true;
      at = parentOf.get(at);
    }
    return false;
  };
  const loose = [...links.keys()].filter((name) => !reached(name));
  if (loose.length === 0) return;
  problems.push(`not connected to "${root}" and not drawn: ${loose.join(', ')}`);
  const gone = new Set(loose);
  for (const name of loose) links.get(name)?.remove();
  for (const joint of childrenNamed(robot, 'joint')) {
    if (gone.has(childrenNamed(joint, 'child')[0]?.getAttribute('link') ?? '')) joint.remove();
  }
}

function mendJoints(robot: Element, problems: string[]): void {
  const joints = new Map(childrenNamed(robot, 'joint').map((joint) => [nameOf(joint), joint]));
  for (const [name, joint] of joints) {
    const axis = childrenNamed(joint, 'axis')[0]?.getAttribute('xyz')?.split(' ').map(Number);
    const turns = joint.getAttribute('type') !== 'fixed';
    if (turns && axis?.every((component) => component === 0)) {
      problems.push(`joint ${name}: its axis is zero; it is drawn as fixed`);
      joint.setAttribute('type', 'fixed');
    }
    for (const mimic of childrenNamed(joint, 'mimic')) {
      const leader = mimic.getAttribute('joint') ?? '';
      if (joints.has(leader)) continue;
      problems.push(`joint ${name}: mimics "${leader}", which does not exist`);
      mimic.remove();
    }
  }
}

function childrenNamed(element: Element, name: string): Element[] {
  return [...element.children].filter((child) => child.nodeName === name);
}

function nameOf(element: Element): string {
  return element.getAttribute('name') ?? '';
}
