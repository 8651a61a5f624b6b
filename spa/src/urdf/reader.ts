import { rpyOf } from '../model/vectors.ts';
import { distrustMasses, type Finding, isPrintable, quoted } from './finding.ts';
import type { Text } from './text.ts';
import {
  type Inertial,
  type Joint,
  type JointType,
  type Limit,
  type Link,
  type Material,
  type Mimic,
  SCALAR_TYPES,
  type Shape,
  type Urdf,
  type Vector,
  type Visual,
} from './types.ts';
import { readXml, type XmlElement, XmlRefused } from './xml.ts';

/**
 * Reads a URDF the same way as the edge (posecast_edge.model.urdf.reader): an unreadable value is reported and replaced by the
 * URDF default for a missing value.
 */

const TYPES: ReadonlySet<string> = new Set([...SCALAR_TYPES, 'fixed', 'floating', 'planar']);
const ZERO: Vector = [0, 0, 0];
const ONES: Vector = [1, 1, 1];
const MAX_LINKS = 1000;
const MAX_SHAPES = 2048;
const MAX_NAME = 200;
const SIZES: Readonly<Record<string, readonly string[]>> = {
  box: ['size'],
  cylinder: ['radius', 'length'],
  sphere: ['radius'],
  capsule: ['radius', 'length'],
};
/** The version since which `quat_xyzw` is read, as urdfdom does, and the newest one, as numbers: 1002 is 1.2. */
const [QUATERNIONS_SINCE, NEWEST] = [1001, 1002];
/** The attributes of the elements that place or move something; others are reported. */
const ATTRIBUTES: Readonly<Record<string, readonly string[]>> = {
  origin: ['xyz', 'rpy', 'quat_xyzw'],
  axis: ['xyz'],
  limit: ['lower', 'upper', 'velocity', 'effort', 'acceleration', 'deceleration', 'jerk'],
  mimic: ['joint', 'multiplier', 'offset'],
  mesh: ['filename', 'scale'],
};
const ROOTS_OF_OTHERS: Readonly<Record<string, string>> = {
  sdf: 'this is SDF, not URDF',
  mujoco: 'this is a MuJoCo model, not URDF',
  html: 'this is an HTML page, not URDF',
  COLLADA: 'this is a Collada mesh, not URDF',
  package: 'this is a ROS package.xml, not URDF',
  launch: 'this is a ROS launch file, not URDF: give the URDF or xacro that it loads',
};
const SRDF_TAGS = new Set([
  ...['group', 'group_state', 'end_effector', 'virtual_joint', 'disable_collisions', 'passive_joint'],
]);
const SENSOR_TAGS = new Set(['camera', 'ray', 'imu', 'force_torque', 'contact', 'gps', 'lidar']);

/** Reads the text of a URDF. Throws XmlRefused if it is no URDF at all. */
export function parseUrdf({ text, findings }: Text): Urdf {
  const urdf = readUrdf(readXml(text));
  urdf.findings.unshift(...findings);
  return urdf;
}

/** Reads the root element of a URDF. Throws XmlRefused if it is no URDF at all. */
export function readUrdf(root: XmlElement): UrdfReader {
  if (root.tag !== 'robot') {
    const other = Object.hasOwn(ROOTS_OF_OTHERS, root.tag) ? ROOTS_OF_OTHERS[root.tag] : undefined;
    throw new XmlRefused(other ?? `the root element is <${root.tag.slice(0, 40)}>, not <robot>`, root.line);
  }
  const tags = root.children.map(({ tag }) => tag);
  if (tags.some((tag) => SRDF_TAGS.has(tag)) && !tags.includes('link') && !tags.includes('joint'))
    throw new XmlRefused("this is an SRDF, MoveIt's file beside a URDF: give the URDF", root.line);
  return new UrdfReader(root);
}

class UrdfReader implements Urdf {
  readonly name: string;
  links: Link[] = [];
  readonly joints: Joint[] = [];
  readonly materials = new Map<string, Material>();
  sensors: { name: string; link: string; line: number | null }[] = [];
  readonly references: { what: string; name: string; by: string; line: number | null }[] = [];
  readonly findings: Finding[] = [];
  readonly #collisions = new Map<Link, readonly Visual[]>();
  readonly #version: number;
  #shapes = 0;

  constructor(root: XmlElement) {
    this.name = root.get('name') ?? '';
    if (this.name === '') this.#say('hint', 'robot-name', '<robot> has no name', root);
    this.#version = this.#readVersion(root);
    const macro = root.children.find(({ tag }) => tag.startsWith('xacro:'));
    if (macro !== undefined) {
      const text = 'it still has xacro macros; expand them first: xacro robot.xacro > robot.urdf';
      this.#say('error', 'xacro', text, macro);
    }
    for (const element of root.all('material')) this.#define(this.#material(element, 'material'));
    for (const element of root.children) {
      if (element.tag === 'link') this.#link(element);
      else if (element.tag === 'joint') this.#joint(element);
      else if (element.tag === 'sensor') this.#sensorOf(element, element.first('parent'));
      else if (element.tag === 'gazebo') this.#gazebo(element);
      else if (element.tag === 'transmission') this.#transmission(element);
    }
    this.#mountOnLinks();
    this.#showSomething(root);
  }

  #say(severity: Finding['severity'], code: string, text: string, { line }: { line: number | null }): void {
    this.findings.push({ severity, code, text, line });
  }

  /** The URDF's version as a number, 1000 for 1.0 or where it has none. */
  #readVersion(root: XmlElement): number {
    const text = trimmed(root.get('version') || '1.0');
    const numbers = /^(\d{1,4})(?:\.(\d{1,4}))?$/.exec(text);
    if (numbers === null) {
      const say = `<robot version> ${quoted(text, 40)} is not like '1.1'; read as 1.0`;
      this.#say('warning', 'version', say, root);
      return 1000;
    }
    const version = Number(numbers[1]) * 1000 + Math.min(Number(numbers[2] ?? 0), 999);
    if (version > NEWEST) {
      const shown = `${numbers[1]}.${Number(numbers[2] ?? 0)}`;
      const say = `URDF ${shown} is newer than 1.2, the newest that is known; read as 1.2`;
      this.#say('warning', 'version', say, root);
    }
    return version;
  }

  /** Reports attributes that are not read; those of other namespaces belong to other programs. */
  #checkAttributes(element: XmlElement, what: string): void {
    const known = ATTRIBUTES[element.tag]!;
    for (const name of element.attributes) {
      if (known.includes(name) || name.includes(':') || name === 'xmlns') continue;
      const say = `${what}: <${element.tag}> has no attribute ${quoted(name, 40)} in URDF; ignored`;
      this.#say('warning', 'attribute-unknown', say, element);
    }
  }

  /** Shows the collision shapes of a robot without any visuals, such as one made only for planning. */
  #showSomething(root: XmlElement): void {
    const drawn = (shapes: readonly Visual[] = []) => shapes.some(({ shape }) => shape !== null);
    if (this.links.some(({ visuals }) => drawn(visuals))) return;
    if (!this.links.some((link) => drawn(this.#collisions.get(link)))) return;
    this.links = this.links.map((link) => ({ ...link, visuals: this.#collisions.get(link) ?? [] }));
    this.#say('hint', 'collisions-shown', 'no link has a visual; the collision shapes are shown', root);
  }

  /** Defines a material; the first definition of a name applies to the whole robot, as in ROS. */
  #define(material: Material): void {
    if (material.name === '' || (material.rgba === null && material.texture === null)) return;
    const first = this.materials.get(material.name);
    if (first === undefined) {
      this.materials.set(material.name, material);
    } else if (String(first.rgba) !== String(material.rgba) || first.texture !== material.texture) {
      const text = `material ${quoted(material.name)} is defined twice; the first (line ${first.line}) is used`;
      this.#say('hint', 'material-doubled', text, material);
    }
  }

  #link(element: XmlElement): void {
    const name = this.#name(element, 'link');
    if (name === null) return;
    if (this.links.length >= MAX_LINKS) throw new XmlRefused(`more than ${MAX_LINKS} links`, element.line);
    const what = `link ${quoted(name)}`;
    const visuals = element.all('visual').map((one) => this.#visual(one, what));
    const collisions = element.all('collision').map((one) => this.#visual(one, what));
    const inertial = element.first('inertial');
    const since = this.findings.length;
    const mass = inertial === null ? null : this.#inertial(inertial, what);
    distrustMasses(this.findings, since);
    const link = { name, visuals, inertial: mass, line: element.line };
    this.links.push(link);
    this.#collisions.set(link, collisions);
    for (const sensor of element.all('sensor')) this.#sensor(sensor, name);
  }

  #joint(element: XmlElement): void {
    const name = this.#name(element, 'joint');
    if (name === null) return;
    const what = `joint ${quoted(name)}`;
    let type = element.get('type') ?? '';
    if (!TYPES.has(type)) {
      const text = type === '' ? `${what}: no type` : `${what}: unknown type ${quoted(type)}`;
      this.#say('error', 'joint-type', `${text}; shown as fixed`, element);
      type = 'fixed';
    }
    const [parent = '', child = ''] = ['parent', 'child'].map((end) => {
      const found = element.first(end)?.get('link') ?? '';
      if (found === '') this.#say('error', 'joint-ends', `${what}: no ${end} link`, element);
      return found;
    });
    const origin = this.#origin(element, what);
    const axis = element.first('axis');
    const limit = element.first('limit');
    const mimic = element.first('mimic');
    if (axis !== null) this.#checkAttributes(axis, what);
    this.joints.push({
      ...{ name, type: type as JointType, parent, child, ...origin },
      axis: axis === null ? null : this.#vector(axis, 'xyz', [1, 0, 0], what),
      limit: limit === null ? null : this.#limit(limit, what),
      mimic: mimic === null ? null : this.#mimic(mimic, what),
      line: element.line,
    });
  }

  #limit(element: XmlElement, what: string): Limit {
    this.#checkAttributes(element, what);
    const [lower = null, upper = null, velocity = null, effort = null] = (
      ['lower', 'upper', 'velocity', 'effort'] as const
    ).map((name) => this.#number(element, name, null, what));
    return { lower, upper, velocity, effort, line: element.line };
  }

  #mimic(element: XmlElement, what: string): Mimic {
    this.#checkAttributes(element, what);
    const multiplier = this.#number(element, 'multiplier', null, what) ?? 1;
    const offset = this.#number(element, 'offset', null, what) ?? 0;
    return { joint: element.get('joint') ?? '', multiplier, offset, line: element.line };
  }

  #inertial(element: XmlElement, what: string): Inertial | null {
    const inertia = element.first('inertia');
    const massOf = element.first('mass');
    const mass = massOf === null ? null : this.#number(massOf, 'value', null, what);
    if (mass === null) {
      if ((massOf?.get('value') ?? null) === null)
        this.#say('warning', 'inertial-empty', `${what}: an <inertial> without a <mass>`, element);
      return null;
    }
    const moments = ['ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz'].map((name) =>
      inertia === null ? 0 : (this.#number(inertia, name, 0, what) ?? 0),
    );
    return { mass, moments, ...this.#origin(element, what), line: element.line };
  }

  #visual(element: XmlElement, what: string): Visual {
    this.#shapes += 1;
    if (this.#shapes > MAX_SHAPES)
      throw new XmlRefused(`more than ${MAX_SHAPES} visuals and collisions`, element.line);
    const origin = this.#origin(element, what);
    const holder = element.first('geometry');
    const material =
      element.tag === 'visual' ? (element.first('material') ?? holder?.first('material') ?? null) : null;
    const shape = holder === null ? null : this.#shape(holder, what);
    if (shape === null) {
      this.#say('warning', `${element.tag}-empty`, `${what}: a ${element.tag} without a geometry`, element);
    }
    const paint = material === null ? null : this.#material(material, what);
    if (paint !== null) this.#define(paint);
    return { ...origin, shape, material: paint, line: element.line };
  }

  #shape(holder: XmlElement, what: string): Shape | null {
    const isShape = ({ tag }: XmlElement) => tag === 'mesh' || Object.hasOwn(SIZES, tag);
    for (const one of holder.children) {
      if (!isShape(one) && one.tag !== 'material')
        this.#say('warning', 'shape-unknown', `${what}: unknown shape ${quoted(one.tag)}`, one);
    }
    const known = holder.children.filter(isShape);
    if (known.length > 1) {
      const text = `${what}: several shapes in one geometry; the first is used`;
      this.#say('warning', 'shape-several', text, holder);
    }
    const [shape] = known;
    if (shape === undefined) return null;
    const { tag, line } = shape;
    if (tag === 'mesh') {
      this.#checkAttributes(shape, what);
      const uri = trimmed(shape.get('filename') ?? '');
      if (uri === '') {
        this.#say('error', 'mesh-unnamed', `${what}: a mesh without a filename`, shape);
        return null;
      }
      let scale = this.#vector(shape, 'scale', ONES, what);
      if (scale.includes(0)) {
        this.#say('error', 'scale-zero', `${what}: a mesh scaled by 0`, shape);
        scale = ONES;
      }
      return { kind: 'mesh', uri, scale, dims: [], line };
    }
    const dims = (SIZES[tag] ?? []).flatMap((name) =>
      name === 'size' ? this.#vector(shape, name, ZERO, what) : [this.#number(shape, name, 0, what) ?? 0],
    );
    if (Math.min(...dims) <= 0) {
      this.#say('error', 'shape-size', `${what}: a ${tag} needs sizes above 0`, shape);
      return null;
    }
    return { kind: tag as Shape['kind'], uri: '', scale: ONES, dims, line };
  }

  #material(element: XmlElement, of: string): Material {
    const name = element.get('name') ?? '';
    const what = of === 'material' ? `material ${quoted(name)}` : `${of}, material ${quoted(name)}`;
    const color = element.first('color');
    const texture = element.first('texture')?.get('filename') || null;
    return { name, rgba: color === null ? null : this.#rgba(color, what), texture, line: element.line };
  }

  #rgba(color: XmlElement, what: string): number[] | null {
    let values = floats(color.get('rgba') ?? '');
    if (values?.length === 3) values = [...values, 1];
    if (values?.length !== 4 || !values.every(Number.isFinite)) {
      this.#say('warning', 'color', `${what}: rgba needs four numbers from 0 to 1`, color);
      return null;
    }
    const [most, least] = [Math.max(...values), Math.min(...values)];
    if (most > 1 || least < 0) {
      const bytes = most > 1 && least >= 0 && most <= 255;
      this.#say('warning', 'color', `${what}: rgba outside 0 … 1${bytes ? '; read as 0 … 255' : ''}`, color);
      const scale = bytes ? 255 : 1;
      values = values.map((value, i) => (i < 3 || value > 1 ? value / scale : value));
    }
    return values.map((value) => Math.min(Math.max(value, 0), 1));
  }

  #sensor(element: XmlElement, link: string): void {
    const kind = element.get('type') || (element.children.find(({ tag }) => SENSOR_TAGS.has(tag))?.tag ?? '');
    if (element.first('pose') === null) this.#origin(element, 'sensor');
    const name = element.get('name') || kind || 'sensor';
    this.sensors.push({ name: [...name].slice(0, MAX_NAME).join(''), link, line: element.line });
  }

  #sensorOf(element: XmlElement, parent: XmlElement | null): void {
    this.#sensor(element, parent?.get('link') || parent?.get('joint') || '');
  }

  /** Mounts a sensor that the file places on a joint, as force sensors are, on the joint's child link. */
  #mountOnLinks(): void {
    const links = new Set(this.links.map(({ name }) => name));
    const children = new Map<string, string>();
    for (const { name, child } of this.joints) if (!children.has(name)) children.set(name, child);
    this.sensors = this.sensors.map((sensor) =>
      links.has(sensor.link) ? sensor : { ...sensor, link: children.get(sensor.link) ?? sensor.link },
    );
  }

  #gazebo(element: XmlElement): void {
    const reference = element.get('reference') ?? '';
    if (reference !== '')
      this.references.push({ what: 'link or joint', name: reference, by: '<gazebo>', line: element.line });
    for (const sensor of element.all('sensor')) this.#sensor(sensor, reference);
  }

  #transmission(element: XmlElement): void {
    for (const joint of element.all('joint')) {
      const name = joint.get('name') ?? '';
      if (name !== '') this.references.push({ what: 'joint', name, by: '<transmission>', line: joint.line });
    }
  }

  #name(element: XmlElement, what: string): string | null {
    const name = element.get('name') ?? '';
    if (name === '') {
      this.#say('error', 'name-missing', `a ${what} without a name; left out`, element);
      return null;
    }
    if ([...name].length > MAX_NAME || !isPrintable(name)) {
      const text = `${what} ${quoted(name)}: longer than ${MAX_NAME} or with control characters; left out`;
      this.#say('error', 'name-unusable', text, element);
      return null;
    }
    if (name !== trimmed(name)) {
      this.#say('warning', 'name-odd', `${what} ${quoted(name)}: spaces around the name`, element);
    } else if (['__proto__', 'constructor', 'prototype'].includes(name) || /[<>&"'`]/.test(name)) {
      this.#say('warning', 'name-odd', `${what} ${quoted(name)}: this name breaks other programs`, element);
    }
    return name;
  }

  #origin(element: XmlElement, what: string): { xyz: Vector; rpy: Vector } {
    const origin = element.first('origin');
    if (origin === null) return { xyz: ZERO, rpy: ZERO };
    this.#checkAttributes(origin, what);
    return { xyz: this.#vector(origin, 'xyz', ZERO, what), rpy: this.#rpy(origin, what) };
  }

  /** An origin's rotation, which URDF 1.1 may give as a quaternion instead. */
  #rpy(origin: XmlElement, what: string): Vector {
    if (origin.get('quat_xyzw') === null) return this.#vector(origin, 'rpy', ZERO, what);
    if (this.#version < QUATERNIONS_SINCE) {
      const say = `${what}: <origin quat_xyzw> is read only with <robot version="1.1">; ignored`;
      this.#say('warning', 'quaternion', say, origin);
      return this.#vector(origin, 'rpy', ZERO, what);
    }
    if (origin.get('rpy') !== null) {
      const say = `${what}: <origin> has both rpy and quat_xyzw; remove one. It is not turned`;
      this.#say('error', 'quaternion', say, origin);
      return ZERO;
    }
    const values = this.#numbers(origin, 'quat_xyzw', what);
    if (values === null) return ZERO;
    if (values.length !== 4) {
      this.#say('error', 'number', `${what}: <origin quat_xyzw> needs four numbers`, origin);
      return ZERO;
    }
    const length = Math.max(...values.map(Math.abs));
    if (!(length > 1e-100 && length < 1e100)) {
      this.#say(
        'error',
        'quaternion',
        `${what}: <origin quat_xyzw> has no direction; it is not turned`,
        origin,
      );
      return ZERO;
    }
    const [x = 0, y = 0, z = 0, w = 0] = values.map((value) => value / length);
    return rpyOf([w, x, y, z]);
  }

  #vector(element: XmlElement, name: string, absent: Vector, what: string): Vector {
    if (element.get(name) === null) return absent;
    const values = this.#numbers(element, name, what);
    if (values === null) return absent;
    if (values.length === 1 && name === 'scale') return [values[0]!, values[0]!, values[0]!];
    if (values.length !== 3) {
      this.#say('error', 'number', `${what}: <${element.tag} ${name}> needs three numbers`, element);
      return absent;
    }
    return [values[0]!, values[1]!, values[2]!];
  }

  #number(element: XmlElement, name: string, absent: number | null, what: string): number | null {
    if (element.get(name) === null) return absent;
    const values = this.#numbers(element, name, what);
    if (values === null) return absent;
    if (values.length !== 1) {
      this.#say('error', 'number', `${what}: <${element.tag} ${name}> needs one number`, element);
      return absent;
    }
    return values[0]!;
  }

  #numbers(element: XmlElement, name: string, what: string): number[] | null {
    const text = element.get(name) ?? '';
    let values = floats(text);
    if (values === null && text.includes(',')) {
      values = floats(withoutCommas(text));
      if (values !== null) {
        const words = `${what}: <${element.tag} ${name}> with commas: ${quoted(text, 40)}; other programs refuse it`;
        this.#say('warning', 'number-commas', words, element);
      }
    }
    if (values?.every(Number.isFinite)) return values;
    const expandable = text.includes('${') || text.includes('$(');
    const wrong = expandable
      ? 'was not expanded by xacro'
      : values === null
        ? 'is not a number'
        : 'is not finite';
    this.#say('error', 'number', `${what}: <${element.tag} ${name}> ${wrong}: ${quoted(text, 40)}`, element);
    return null;
  }
}

const NUMBER = /^[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d+)?$/i;
/** White space as in Python: U+FEFF is none, U+0085 is one. */
const SPACES = /(?:(?!\ufeff)[\s\u0085])+/;
const NO_NUMBER = /^[+-]?(?:nan|inf(?:inity)?)$/i;

/** The numbers in a text, NaN for those that are not finite; null if it has anything else. */
function floats(text: string): number[] | null {
  const words = text.slice(0, 1000).split(SPACES).filter(Boolean);
  if (!words.every((word) => NUMBER.test(word) || NO_NUMBER.test(word))) return null;
  return words.map((word) => (NUMBER.test(word) ? Number(word) : Number.NaN));
}

/** Removes commas between numbers; a comma that may be a decimal comma stays. */
function withoutCommas(text: string): string {
  return SPACES.test(trimmed(text)) ? text.replaceAll(', ', ' ') : text.replaceAll(',', ' ');
}

/** Removes white space (as in Python) around a text. */
function trimmed(text: string): string {
  let [from, to] = [0, text.length];
  while (from < to && SPACES.test(text[from]!)) from += 1;
  while (to > from && SPACES.test(text[to - 1]!)) to -= 1;
  return text.slice(from, to);
}
