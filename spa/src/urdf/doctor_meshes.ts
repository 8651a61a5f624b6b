import { emptyBox, expandByBox, type LinkBox } from '../model/bounds.ts';
import { multiply, transform } from '../model/kinematics.ts';
import { type MeshFacts, missingMesh } from '../model/report.ts';
import { quatOfRpy } from '../model/vectors.ts';
import { type Finding, general, isPrintable, quoted, type Say } from './finding.ts';
import type { Tree } from './tree.ts';
import { materialOf, type Shape, type Urdf, type Vector } from './types.ts';

/** Finds problems in a robot's meshes: missing, of an unlikely size, or with faults that the reader worked around. The rules are
 *  those of `posecast-edge doctor` (posecast_edge.model.doctor.meshes). */

const LARGE_M = 20;
const SMALL_M = 0.05;
const SPECK_M = 1e-4;
const HEAVY_BYTES = 20_000_000;

type Named = readonly [link: string, shape: Shape];
export type Facts = ReadonlyMap<string, MeshFacts>;

/** The findings. `missing`: URIs (meshes, textures) without a file, and why; `read`: facts about the meshes, null before they are
 *  read; `hints`: how files were found whose URI is not quite right. */
export function meshFindings(
  urdf: Urdf,
  tree: Tree,
  missing: ReadonlyMap<string, string>,
  read: Facts | null,
  hints: ReadonlyMap<string, string>,
): Finding[] {
  const found: Finding[] = [];
  const say: Say = (severity, code, text, line) => found.push({ severity, code, text, line });
  const shapes = urdf.links.flatMap(({ name, visuals }) =>
    visuals.flatMap(({ shape }): Named[] => (shape === null ? [] : [[name, shape]])),
  );
  if (urdf.links.length > 0 && shapes.length === 0)
    say('warning', 'nothing-drawn', 'no link has a visual: only the skeleton is drawn', null);
  for (const [link, shape] of shapes) scale(link, shape, say);
  const facts = new Map(read);
  for (const [uri, reason] of missing) facts.set(uri, missingMesh(reason));
  files(shapes, facts, hints, say);
  pictures(urdf, missing, say);
  if (read === null) return found;
  for (const [link, shape] of shapes) size(link, shape, facts, say);
  whole(tree, facts, say);
  const bytes = [...facts.values()].reduce((sum, fact) => sum + fact.bytes, 0);
  const triangles = [...facts.values()].reduce((sum, fact) => sum + fact.triangles, 0);
  if (bytes > HEAVY_BYTES) {
    const text = `the meshes have ${(bytes / 1e6).toFixed(1)} MB and ${triangles.toLocaleString('en-US')} triangles`;
    say('hint', 'bundle-size', `${text}; \`posecast-edge model build\` makes them small`, null);
  }
  return found;
}

function scale(link: string, shape: Shape, say: Say): void {
  if (shape.kind !== 'mesh') return;
  const [x, y, z] = shape.scale;
  if (x * y * z < 0) {
    const text = `link ${quoted(link)}: a mirrored mesh (negative scale); some programs turn it inside out`;
    say('hint', 'scale-mirrored', text, shape.line);
  }
  const sizes = shape.scale.map(Math.abs);
  if (Math.max(...sizes) > 1.01 * Math.min(...sizes)) {
    const by = shape.scale.map((value) => general(value)).join(' ');
    say('hint', 'scale-uneven', `link ${quoted(link)}: a mesh stretched by ${by}`, shape.line);
  }
}

/** Reports findings about mesh files, once for each file or kind of note. */
function files(shapes: readonly Named[], facts: Facts, hints: ReadonlyMap<string, string>, say: Say): void {
  const users = new Map<string, Named[]>();
  for (const named of shapes) {
    const { uri } = named[1];
    if (uri === '') continue;
    const by = users.get(uri) ?? [];
    by.push(named);
    users.set(uri, by);
  }
  const lenient = new Map<string, { code: string; text: string; uris: string[] }>();
  for (const [uri, by] of users) {
    const fact = facts.get(uri);
    if (fact === undefined) continue;
    const [link, { line }] = by[0]!;
    if (fact.reason !== null) {
      const others = by.some(([other]) => other !== link) ? ' and others' : '';
      const code = fact.reason.startsWith('no such file') ? 'mesh-missing' : 'mesh-broken';
      say('error', code, `mesh ${quoted(uri)} of link ${quoted(link)}${others}: ${shown(fact.reason)}`, line);
    }
    const hint = hints.get(uri);
    if (hint !== undefined) say('hint', 'mesh-found', `mesh ${quoted(uri)}: ${shown(hint)}`, line);
    for (const [code, text] of fact.notes) {
      const key = JSON.stringify([code, text]);
      const note = lenient.get(key) ?? { code, text, uris: [] };
      note.uris.push(uri);
      lenient.set(key, note);
    }
  }
  for (const { code, text, uris } of lenient.values()) {
    const first = uris[0]!;
    const more = uris.length > 1 ? ` and ${uris.length - 1} more` : '';
    say('hint', code, `mesh ${quoted(first)}${more}: ${shown(text)}`, users.get(first)![0]![1].line);
  }
}

/** Makes a text that may come from an untrusted file safe to show. */
const shown = (text: string) => [...text].map((c) => (isPrintable(c) ? c : '�')).join('');

/** Reports textures that the URDF itself names and that can't be shown. */
function pictures(urdf: Urdf, missing: ReadonlyMap<string, string>, say: Say): void {
  const told = new Set<string>();
  for (const { name, visuals } of urdf.links) {
    for (const visual of visuals) {
      const material = visual.shape === null ? null : materialOf(visual, urdf);
      const reason = missing.get(material?.texture ?? '');
      if (material?.texture == null || reason === undefined || told.has(material.texture)) continue;
      told.add(material.texture);
      const text = `texture ${quoted(material.texture)} of link ${quoted(name)}: ${shown(reason)}`;
      say('error', 'texture-missing', text, material.line);
    }
  }
}

function size(link: string, shape: Shape, facts: Facts, say: Say): void {
  const box = boxOf(shape, facts);
  if (box === null) return;
  const longest = longestSide(box);
  const what = `link ${quoted(link)}: its ${shape.kind}`;
  if (longest > LARGE_M) {
    const advice = shape.kind === 'mesh' ? ': millimetres? scale="0.001 0.001 0.001"' : '';
    say('warning', 'mesh-large', `${what} is ${general(longest, 3)} m long${advice}`, shape.line);
  } else if (longest < SPECK_M) {
    say('warning', 'mesh-small', `${what} is only ${general(longest, 3)} m long`, shape.line);
  }
}

/** root_from_link of each link with all joints at 0, column-major. */
export function zeroPoses({ root, joints }: Tree): ReadonlyMap<string, readonly number[]> {
  if (root === null) return new Map();
  const poses = new Map([[root.name, poseOf({ xyz: [0, 0, 0], rpy: [0, 0, 0] })]]);
  for (const joint of joints) poses.set(joint.child, product(poses.get(joint.parent)!, poseOf(joint)));
  return poses;
}

/** The box around everything shown with all joints at 0, in the root's axes, m; empty if nothing is shown. */
export function robotBox(tree: Tree, facts: Facts): LinkBox {
  const whole = emptyBox();
  for (const [name, pose] of zeroPoses(tree)) {
    for (const visual of tree.links.get(name)?.visuals ?? []) {
      const box = visual.shape === null ? null : boxOf(visual.shape, facts);
      if (box !== null) expandByBox(whole.min, whole.max, box, product(pose, poseOf(visual)), 0);
    }
  }
  return whole;
}

/** The length of a box's longest side, m; -∞ for an empty one. */
export function longestSide({ min, max }: LinkBox): number {
  return Math.max(...max.map((high, i) => high - min[i]!));
}

/** Reports an unlikely size of the robot with all joints at 0. */
function whole(tree: Tree, facts: Facts, say: Say): void {
  const largest = longestSide(robotBox(tree, facts));
  if (largest > LARGE_M) {
    const text = `the robot measures ${general(largest, 3)} m: are its meshes or origins in millimetres?`;
    say('warning', 'robot-large', text, null);
  } else if (largest >= 0 && largest < SMALL_M) {
    say(
      'warning',
      'robot-small',
      `the robot measures only ${general(largest, 3)} m: is it scaled twice?`,
      null,
    );
  }
}

/** The bounding box of a shape in the visual's axes, m; null for a missing mesh. */
export function boxOf({ kind, uri, scale: by, dims }: Shape, facts: Facts): LinkBox | null {
  if (kind === 'mesh') {
    const fact = facts.get(uri);
    if (fact === undefined || fact.reason !== null) return null;
    const ends = by.map((factor, i) => [fact.low[i]! * factor, fact.high[i]! * factor]);
    const edge = (pick: (...ends: number[]) => number) => ends.map((both) => pick(...both)) as LinkBox['min'];
    return { min: edge(Math.min), max: edge(Math.max) };
  }
  const [first = 0, second = 0, third = 0] = dims;
  const upright = { box: third / 2, sphere: first, cylinder: second / 2, capsule: second / 2 + first }[kind];
  const [x, y] = kind === 'box' ? [first / 2, second / 2] : [first, first];
  return { min: [-x, -y, -upright], max: [x, y, upright] };
}

/** parent_from_this, column-major. */
export function poseOf({ xyz, rpy }: { readonly xyz: Vector; readonly rpy: Vector }): number[] {
  return transform(xyz, quatOfRpy(rpy));
}

function product(a: readonly number[], b: readonly number[]): number[] {
  const out = new Float64Array(16);
  multiply(out, 0, a, 0, b, 0);
  return [...out];
}
