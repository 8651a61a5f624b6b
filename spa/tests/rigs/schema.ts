import { Encoder, MISSING, parseSchema, type Schema } from '@posecast/wire';
import type { RobotState } from '../../src/twin/robot.ts';

/** A small robot with one of everything, for the tests of twin, stream and table. */
export const SCHEMA_TEXT = JSON.stringify({
  type: 'schema',
  v: 1,
  robot: 'Small',
  labels: {
    joint: ['LKN', 'RKN', 'NK1'],
    ftf: ['RF.fz'],
    ftm: ['RF.mx', 'RF.my'],
    quat: ['torso.w', 'torso.x', 'torso.y', 'torso.z'],
    axis: ['torso.x', 'torso.y', 'torso.z'],
    power: ['main'],
    sonar: ['front'],
  },
  fields: [
    { name: 'ref', unit: 'rad', scale: 0.001, labels: 'joint' },
    { name: 'pos', unit: 'rad', scale: 0.001, labels: 'joint', rel: 'ref' },
    { name: 'cur', unit: 'A', scale: 0.01, labels: 'joint' },
    { name: 'ftf', unit: 'N', scale: 1, labels: 'ftf' },
    { name: 'ftm', unit: 'Nm', scale: 0.05, labels: 'ftm' },
    { name: 'quat', scale: 0.001, labels: 'quat' },
    { name: 'gyro', unit: 'rad/s', scale: 0.01, labels: 'axis' },
    { name: 'volt', unit: 'V', scale: 0.05, labels: 'power' },
    { name: 'range', unit: 'm', scale: 0.01, labels: 'sonar' },
    { name: 'temp', unit: 'C', scale: 1, labels: 'joint' },
    { name: 'flags', bits: ['homed', 'enabled', 'jam', 'pwmSaturated', 'comply'], labels: 'joint' },
  ],
  mapping: {
    joints: { knee_left: { terms: [['LKN', 2]], offset: 0.5 } },
    sensors: { RF: { kind: 'wrench', name: 'right foot', link: 'foot' } },
    names: { RKN: 'right knee' },
    thresholds: { temp: { '*': { high: 70, caution: 0.8 } }, ftf: { 'RF.fz': { high: 500, caution: 0.5 } } },
    tolerance: { '*': 0.05 },
    severity: { flags: { pwmSaturated: 'caution', homed: 'state', enabled: 'state', comply: 'state' } },
  },
});

export const SCHEMA = parseSchema(SCHEMA_TEXT);

/** A schema with these labels and fields. `more`: its mapping, or another name than 'r'. */
export function schemaWith(labels: object, fields: readonly object[], more: object = {}): Schema {
  return parseSchema(JSON.stringify({ type: 'schema', v: 1, robot: 'r', labels, fields, ...more }));
}

/** The fields and labels of a base that is reported, millimetres and thousandths. */
export const BASE_LABELS = {
  base: ['base.x', 'base.y', 'base.z'],
  baseq: ['base.w', 'base.x', 'base.y', 'base.z'],
};
export const BASE_FIELDS = [
  { name: 'base', unit: 'm', scale: 0.001, labels: 'base' },
  { name: 'baseq', scale: 0.001, labels: 'baseq' },
];

/** The state of a frame that arrived without delay. */
export function stateAt(atMs: number, codes = codesWith(), more: Partial<RobotState> = {}): RobotState {
  const times = { tS: 0, freshMs: 0, bornMs: 0, changedMs: 0, atMs };
  return { schemaId: SCHEMA.id, seq: 1, codes, ...times, ...more };
}

/** A state as the stream hands it over. */
export function stateOf(codes: Int32Array, more: Partial<RobotState> = {}): RobotState {
  return stateAt(0, codes, more);
}

type Codes = Readonly<Record<string, number | null>>;

/** Codes of a schema, all zero but these: `{ 'pos.RKN': 520 }`. null is no reading. */
export function codesOf(schema: Schema, given: Codes): Int32Array {
  const codes = new Int32Array(schema.size);
  for (const [channel, code] of Object.entries(given)) {
    const [name, ...label] = channel.split('.');
    const field = schema.field(name!);
    const index = field?.labels.indexOf(label.join('.')) ?? -1;
    if (field === null || index < 0) throw new Error(`no channel ${channel}`);
    codes[field.start + index] = code ?? MISSING;
  }
  return codes;
}

/** Codes of a pose at rest, with changes. */
export function codesWith(changed: Codes = {}): Int32Array {
  const joints = ['LKN', 'RKN', 'NK1'].flatMap((label) => [
    [`flags.${label}`, 0b11],
    [`temp.${label}`, 33],
  ]);
  return codesOf(SCHEMA, { 'quat.torso.w': 1000, ...Object.fromEntries(joints), ...changed });
}

/** The frames of one run, as an edge would send them. */
export class Frames {
  readonly #encoder: Encoder;
  #seq: number;
  #nowS = 0;

  constructor(firstSeq = 1) {
    this.#encoder = new Encoder(SCHEMA);
    this.#seq = firstSeq;
  }

  next(changed: Readonly<Record<string, number | null>> = {}, forceKey = false): Uint8Array {
    this.#nowS += 1 / 30;
    return this.#encoder.encode(codesWith(changed), this.#seq++, this.#nowS, this.#nowS, forceKey);
  }
}
