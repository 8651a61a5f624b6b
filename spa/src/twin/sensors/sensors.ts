import type { Field, Level, Schema } from '@posecast/wire';
import { numberOf } from '../joints.ts';
import { LevelLatch, ValueLimits } from '../limits.ts';
import { isolated, placeOf } from '../names.ts';
import { rpyOf, normalizeQuat as unitQuat } from '../rotation.ts';
import { type ChannelReader, valueAt } from '../values.ts';

/** One number of a sensor, with its name, unit and newest value. */
export interface Reading {
  readonly field: string;
  readonly label: string;
  /** The short label of the number: "Fz", "roll", "ωx". */
  readonly name: string;
  readonly unit: string;
  /** The value of one code (the resolution), in the unit. */
  readonly scale: number;
  value: number | null;
  level: Level;
}

/** The readings of one sensor, power source or field, or the position of the robot's base. */
export interface SensorGroup {
  readonly kind: 'base' | 'wrench' | 'imu' | 'power' | 'other';
  readonly site: string;
  /** The plain name, if the profile has one. */
  readonly title: string;
  readonly readings: readonly Reading[];
}

/** The words for the base, for power and its fields in the viewer's language; anything without a word keeps the robot's name. */
export interface SensorWords {
  readonly base?: string;
  readonly power: string;
  readonly volt?: string;
  readonly amp?: string;
  readonly watt?: string;
  readonly charge?: string;
}

const KIND_OF_FIELD: Readonly<Record<string, Exclude<SensorGroup['kind'], 'other'>>> = {
  base: 'base',
  baseq: 'base',
  ftf: 'wrench',
  ftm: 'wrench',
  quat: 'imu',
  tilt: 'imu',
  gyro: 'imu',
  acc: 'imu',
  volt: 'power',
  amp: 'power',
  watt: 'power',
  charge: 'power',
};
const UNIT_OF_FIELD: Readonly<Record<string, string>> = {
  base: 'm',
  ftf: 'N',
  ftm: 'Nm',
  tilt: 'rad',
  gyro: 'rad/s',
  acc: 'm/s2',
  volt: 'V',
  amp: 'A',
  watt: 'W',
};
const NAMES: Readonly<Record<string, Readonly<Record<string, string>>>> = {
  ftf: { fx: 'Fx', fy: 'Fy', fz: 'Fz' },
  ftm: { mx: 'Mx', my: 'My', mz: 'Mz' },
  gyro: { x: 'ωx', y: 'ωy', z: 'ωz' },
  acc: { x: 'ax', y: 'ay', z: 'az' },
};
/** Fields with quaternions, which are shown as angles. */
const QUATERNIONS = new Set(['quat', 'baseq']);
const EULER = ['roll', 'pitch', 'yaw'] as const;

type Source = { from: Field; index: number } | { quat: readonly number[]; field: Field; angle: number };

/** All readings other than joints, grouped by the site where they are measured; the base's position comes first. `read`
 *  overwrites them in place. */
export class SensorTable {
  readonly groups: readonly SensorGroup[];
  readonly #schema: Schema;
  readonly #words: SensorWords;
  readonly #profileLimits: ValueLimits;
  readonly #all: { reading: Reading; source: Source; latch: LevelLatch }[] = [];

  constructor(schema: Schema, words: SensorWords = { power: 'Power' }) {
    this.#schema = schema;
    this.#words = words;
    this.#profileLimits = new ValueLimits(schema.mapping);
    const groups = new Map<string, { kind: SensorGroup['kind']; site: string; readings: Reading[] }>();
    const main = schema.field('pos') ?? schema.field('ref');
    for (const field of schema.fields) {
      if (field.bits.length > 0) continue; // bits are reported as alarms
      const ofJoints = field.labelSet === main?.labelSet;
      if (ofJoints && numberOf(field.name) !== undefined) continue;
      const kind = KIND_OF_FIELD[field.name] ?? 'other';
      field.labels.forEach((label, index) => {
        const [site, component] = split(label, kind);
        const key = kind === 'other' ? `other ${field.name}` : `${kind} ${site}`;
        const group = groups.get(key) ?? { kind, site: kind === 'other' ? field.name : site, readings: [] };
        groups.set(key, group);
        if (QUATERNIONS.has(field.name)) {
          if (component === 'w') this.#addAngles(group.readings, field, site);
          return;
        }
        const unit = field.unit || (UNIT_OF_FIELD[field.name] ?? '');
        const name =
          kind === 'power'
            ? label === 'main'
              ? (this.#powerName(field.name) ?? field.name)
              : label
            : component;
        this.#add(
          group.readings,
          {
            field: field.name,
            label,
            name: NAMES[field.name]?.[component] ?? isolated(name),
            unit,
            scale: field.scale,
          },
          { from: field, index },
        );
      });
    }
    const order = ['base', 'wrench', 'imu', 'power', 'other'];
    this.groups = [...groups.values()]
      .sort((a, b) => order.indexOf(a.kind) - order.indexOf(b.kind))
      .map((group) => ({ ...group, title: this.#title(group.kind, group.site) }));
  }

  read(codes: Int32Array, limits: ValueLimits = this.#profileLimits): readonly SensorGroup[] {
    for (const { reading, source, latch } of this.#all) {
      reading.value = readFrom(codes, source);
      const threshold = 'from' in source ? limits.threshold(reading.field, reading.label) : null;
      reading.level = latch.next(threshold, reading.value);
    }
    return this.groups;
  }

  /** A reading, and a function that reads it from any frame's codes; null if there is none with that name. */
  reader(field: string, label: string): { readonly reading: Reading; readonly read: ChannelReader } | null {
    const found = this.#all.find(({ reading }) => reading.field === field && reading.label === label);
    if (found === undefined) return null;
    return { reading: found.reading, read: (codes) => readFrom(codes, found.source) };
  }

  #powerName(field: string): string | undefined {
    return field === 'volt' || field === 'amp' || field === 'watt' || field === 'charge'
      ? this.#words[field]
      : undefined;
  }

  #title(kind: SensorGroup['kind'], site: string): string {
    if (kind === 'power')
      return site === 'main' ? this.#words.power : `${this.#words.power}, ${isolated(site)}`;
    if (kind === 'base' && site === 'base' && this.#words.base !== undefined) return this.#words.base;
    return isolated(this.#schema.mapping.sensors.get(site)?.name ?? site);
  }

  #addAngles(readings: Reading[], field: Field, site: string): void {
    const quat = ['w', 'x', 'y', 'z'].map((c) => placeOf(field.labels, `${site}.${c}`));
    if (quat.includes(-1)) return;
    EULER.forEach((name, angle) => {
      this.#add(
        readings,
        { field: field.name, label: `${site}.${name}`, name, unit: 'rad', scale: field.scale },
        { quat, field, angle },
      );
    });
  }

  #add(into: Reading[], fixed: Omit<Reading, 'value' | 'level'>, source: Source): void {
    const reading: Reading = { ...fixed, value: null, level: 'ok' };
    into.push(reading);
    this.#all.push({ reading, source, latch: new LevelLatch() });
  }
}

function split(label: string, kind: SensorGroup['kind']): [string, string] {
  const dot = label.lastIndexOf('.');
  if (dot < 0 || kind === 'power') return [label, label];
  return [label.slice(0, dot), label.slice(dot + 1)];
}

function readFrom(codes: Int32Array, source: Source): number | null {
  return 'from' in source ? valueAt(codes, source.from, source.index) : eulerAngle(codes, source);
}

function eulerAngle(
  codes: Int32Array,
  source: { quat: readonly number[]; field: Field; angle: number },
): number | null {
  const parts: number[] = [];
  for (const index of source.quat) {
    const value = valueAt(codes, source.field, index);
    if (value === null) return null;
    parts.push(value);
  }
  const [w = 0, x = 0, y = 0, z = 0] = parts;
  const turned = unitQuat([w, x, y, z]);
  return turned === null ? null : (rpyOf(turned)[source.angle] ?? null);
}
