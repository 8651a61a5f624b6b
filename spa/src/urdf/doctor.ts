import { VARIABLES } from '../model/kinematics.ts';
import type { MeshFacts } from '../model/report.ts';
import { meshFindings } from './doctor_meshes.ts';
import { type Finding, general, quoted, type Say, worstFirst } from './finding.ts';
import { massFindings } from './masses.ts';
import { buildTree } from './tree.ts';
import {
  type Joint,
  type Link,
  materialOf,
  SCALAR_TYPES,
  UNBOUNDED,
  type Urdf,
  type Vector,
} from './types.ts';

/**
 * Finds things in a URDF that are readable but probably not intended. Rules and wording are those of `posecast-edge doctor`
 * (posecast_edge.model.doctor.skeleton).
 */

const TURN = 2 * Math.PI;
/** A larger distance from one joint to the next (m) suggests a wrong unit. */
const FAR_M = 10;
/** Tolerance for the length of an axis, which should be 1. */
const UNIT = 1e-3;

/** All findings about a URDF, worst first. `missing`: URIs (meshes, textures) without a file, and why; `meshes`: facts of the
 *  other meshes by URI, null before they are read; `hints`: how files were found whose URI is not quite right. */
export function diagnose(
  urdf: Urdf,
  missing: ReadonlyMap<string, string>,
  meshes: ReadonlyMap<string, MeshFacts> | null,
  hints: ReadonlyMap<string, string> = new Map(),
): Finding[] {
  const tree = buildTree(urdf);
  const found: Finding[] = [...urdf.findings, ...tree.findings];
  const say: Say = (severity, code, text, line) => found.push({ severity, code, text, line });
  for (const joint of urdf.joints) examineJoint(joint, say);
  for (const link of urdf.links) examineLink(link, say);
  materials(urdf, say);
  mentions(urdf, say);
  found.push(...massFindings(tree, meshes));
  found.push(...meshFindings(urdf, tree, missing, meshes, hints));
  return worstFirst(found);
}

function examineJoint(joint: Joint, say: Say): void {
  const { type, line, axis } = joint;
  const what = `joint ${quoted(joint.name)}`;
  origin(what, joint.xyz, joint.rpy, line, say);
  if (type === 'planar' || type === 'floating') {
    const channels = VARIABLES[type].map(([variable]) => quoted(`${joint.name}/${variable}`)).join(', ');
    say('hint', 'joint-free', `${what} is ${type}: its channels are ${channels}`, line);
  }
  if (!SCALAR_TYPES.has(type) && joint.mimic !== null)
    say('hint', 'mimic-useless', `${what} is ${type} and mimics another`, line);
  if (type === 'fixed' || type === 'floating') return;
  if (axis === null) {
    const more = type === 'planar' ? ': its plane is vertical; for a floor, use 0 0 1' : '';
    const severity = type === 'planar' ? 'warning' : 'hint';
    say(severity, 'axis-missing', `${what} has no axis; the standard says x (1 0 0)${more}`, line);
  } else {
    const length = Math.hypot(...axis);
    if (length < 1e-9) say('error', 'axis-zero', `${what}: its axis is 0 0 0; read as 1 0 0`, line);
    else if (Math.abs(length - 1) > UNIT) {
      const text = `${what}: its axis has length ${general(length, 3)}, not 1; other programs scale the motion by it`;
      say('warning', 'axis-length', text, line);
    }
  }
  if (SCALAR_TYPES.has(type) && type !== 'continuous') limits(joint, what, say);
}

function limits({ type, limit, line: jointLine }: Joint, what: string, say: Say): void {
  if (limit === null) {
    say('warning', 'limit-missing', `${what} is ${type} and has no <limit>`, jointLine);
    return;
  }
  const { line } = limit;
  if (limit.lower === null && limit.upper === null) {
    const text = `${what}: a <limit> without lower and upper means 0 to 0: it can't move`;
    say('warning', 'limit-empty', text, line);
    return;
  }
  const [lower, upper] = [limit.lower ?? 0, limit.upper ?? 0];
  const shown = `${general(lower)} to ${general(upper)}`;
  if (lower > upper) say('error', 'limit-reversed', `${what}: lower is above upper: ${shown}`, line);
  else if (lower === upper)
    say('warning', 'limit-zero', `${what}: lower and upper are the same: ${shown}`, line);
  else if (lower > 0 || upper < 0) {
    const text = `${what}: 0 is outside its limits, ${shown}: it can't reach the zero pose`;
    say('hint', 'limit-without-zero', text, line);
  }
  const largest = Math.max(Math.abs(lower), Math.abs(upper));
  if (type === 'revolute' && largest > 2 * TURN && largest < UNBOUNDED)
    say('warning', 'limit-degrees', `${what}: limits ${shown} rad: are these degrees?`, line);
  if (type === 'prismatic' && largest > FAR_M && largest < UNBOUNDED)
    say('warning', 'limit-millimetres', `${what}: limits ${shown} m: are these millimetres?`, line);
  if ((limit.velocity ?? 0) < 0 || (limit.effort ?? 0) < 0)
    say('warning', 'limit-negative', `${what}: velocity or effort is below 0`, line);
}

function origin(what: string, xyz: Vector, rpy: Vector, line: number | null, say: Say): void {
  const list = (values: Vector) => values.map((value) => general(value)).join(' ');
  if (Math.max(...rpy.map(Math.abs)) > TURN + 0.01)
    say('warning', 'origin-degrees', `${what}: rpy ${list(rpy)} rad: are these degrees?`, line);
  if (Math.max(...xyz.map(Math.abs)) > FAR_M)
    say('warning', 'origin-far', `${what}: origin ${list(xyz)} m: are these millimetres?`, line);
}

function examineLink({ name, visuals }: Link, say: Say): void {
  for (const { xyz, rpy, line } of visuals) origin(`link ${quoted(name)}, visual`, xyz, rpy, line, say);
}

/** Reports material names that define no colour, each once. */
function materials(urdf: Urdf, say: Say): void {
  const lines = new Map<string, (number | null)[]>();
  for (const visual of urdf.links.flatMap((link) => link.visuals)) {
    const own = visual.material;
    if (own === null || own.name === '' || own.texture !== null) continue;
    const found = materialOf(visual, urdf);
    if (found === null || (found.rgba === null && found.texture === null)) {
      lines.set(own.name, [...(lines.get(own.name) ?? []), own.line]);
    }
  }
  for (const [name, where] of lines) {
    const times = where.length > 1 ? `, ${where.length} times` : '';
    const text = `material ${quoted(name)} has no colour${times}; shown in grey`;
    say('hint', 'material-colour', text, where[0] ?? null);
  }
}

/** Reports sensors, transmissions and <gazebo> elements that name links or joints that don't exist. */
function mentions({ links: all, joints: moved, sensors, references }: Urdf, say: Say): void {
  const links = new Set(all.map(({ name }) => name));
  const joints = new Set(moved.map(({ name }) => name));
  for (const { name, link, line } of sensors) {
    if (links.has(link)) continue;
    const where = link === '' ? 'no link' : `link ${quoted(link)}, which does not exist`;
    say('warning', 'sensor-link', `sensor ${quoted(name)} is on ${where}`, line);
  }
  for (const { what, name, by, line } of references) {
    if (joints.has(name) || (what !== 'joint' && links.has(name))) continue;
    say('warning', 'reference', `${by} refers to ${what} ${quoted(name)}, which does not exist`, line);
  }
}
