import { type Field, type Level, level, type Schema } from '@posecast/wire';
import { valueAt } from './values.ts';

export interface Reading {
  readonly field: string;
  readonly label: string;
  /** What stands in front of the number: "Fz", "roll", "ωx". */
  readonly name: string;
  readonly unit: string;
  readonly scale: number;
  value: number | null;
  level: Level;
}

export interface SensorGroup {
  readonly kind: 'wrench' | 'imu' | 'power' | 'other';
  readonly site: string;
  /** The plain name, when the profile has one. */
  readonly title: string;
  readonly readings: readonly Reading[];
}

const JOINT_FIELDS = new Set(['ref', 'pos', 'vel', 'cur', 'temp', 'flags']);
const BASE_FIELDS = new Set(['base', 'baseq']);
const KIND_OF_FIELD: Readonly<Record<string, 'wrench' | 'imu' | 'power'>> = {
  ftf: 'wrench',
  ftm: 'wrench',
  quat: 'imu',
  gyro: 'imu',
  acc: 'imu',
  volt: 'power',
  amp: 'power',
};
const UNIT_OF_FIELD: Readonly<Record<string, string>> = {
  ftf: 'N',
  ftm: 'Nm',
  gyro: 'rad/s',
  acc: 'm/s2',
  volt: 'V',
  amp: 'A',
};
const NAMES: Readonly<Record<string, Readonly<Record<string, string>>>> = {
  ftf: { fx: 'Fx', fy: 'Fy', fz: 'Fz' },
  ftm: { mx: 'Mx', my: 'My', mz: 'Mz' },
  gyro: { x: 'ωx', y: 'ωy', z: 'ωz' },
  acc: { x: 'ax', y: 'ay', z: 'az' },
};
const EULER = ['roll', 'pitch', 'yaw'] as const;

type Source = { from: Field; index: number } | { quat: readonly number[]; field: Field; angle: number };

/** Everything that is not a joint, grouped as people look for it: by the place it is mounted. */
export class SensorTable {
  readonly groups: readonly SensorGroup[];
  readonly #schema: Schema;
  readonly #all: { reading: Reading; source: Source }[] = [];

  constructor(schema: Schema) {
    this.#schema = schema;
    const groups = new Map<string, { kind: SensorGroup['kind']; site: string; readings: Reading[] }>();
    const main = schema.field('pos') ?? schema.field('ref');
    for (const field of schema.fields) {
      if (BASE_FIELDS.has(field.name)) continue;
      if (JOINT_FIELDS.has(field.name) && field.labelSet === main?.labelSet) continue;
      const kind = KIND_OF_FIELD[field.name] ?? 'other';
      field.labels.forEach((label, index) => {
        const [site, component] = split(label, kind);
        const key = kind === 'other' ? `other ${field.name}` : `${kind} ${site}`;
        const group = groups.get(key) ?? { kind, site: kind === 'other' ? field.name : site, readings: [] };
        groups.set(key, group);
        if (field.name === 'quat') {
          if (component === 'w') this.#addAngles(group.readings, field, site);
          return;
        }
        const unit = field.unit || (UNIT_OF_FIELD[field.name] ?? '');
        const name = kind === 'power' ? (label === 'main' ? field.name : label) : component;
        this.#add(
          group.readings,
          {
            field: field.name,
            label,
            name: NAMES[field.name]?.[component] ?? name,
            unit,
            scale: field.scale,
          },
          { from: field, index },
        );
      });
    }
    const order = ['wrench', 'imu', 'power', 'other'];
    this.groups = [...groups.values()]
      .sort((a, b) => order.indexOf(a.kind) - order.indexOf(b.kind))
      .map((group) => ({ ...group, title: this.#title(group.kind, group.site) }));
  }

  read(codes: Int32Array): readonly SensorGroup[] {
    const { mapping } = this.#schema;
    for (const { reading, source } of this.#all) {
      const channel = 'from' in source;
      reading.value = channel ? valueAt(codes, source.from, source.index) : eulerAngle(codes, source);
      const threshold = channel ? mapping.threshold(reading.field, reading.label) : null;
      reading.level = threshold === null ? 'ok' : level(threshold, reading.value);
    }
    return this.groups;
  }

  #title(kind: SensorGroup['kind'], site: string): string {
    if (kind === 'power') return site === 'main' ? 'Power' : `Power, ${site}`;
    return this.#schema.mapping.sensors.get(site)?.name ?? site;
  }

  #addAngles(readings: Reading[], field: Field, site: string): void {
    const quat = ['w', 'x', 'y', 'z'].map((c) => field.labels.indexOf(`${site}.${c}`));
    if (quat.includes(-1)) return;
    EULER.forEach((name, angle) => {
      this.#add(
        readings,
        { field: 'quat', label: `${site}.${name}`, name, unit: 'rad', scale: field.scale },
        { quat, field, angle },
      );
    });
  }

  #add(into: Reading[], fixed: Omit<Reading, 'value' | 'level'>, source: Source): void {
    const reading: Reading = { ...fixed, value: null, level: 'ok' };
    into.push(reading);
    this.#all.push({ reading, source });
  }
}

function split(label: string, kind: SensorGroup['kind']): [string, string] {
  const dot = label.lastIndexOf('.');
  if (dot < 0 || kind === 'power') return [label, label];
  return [label.slice(0, dot), label.slice(dot + 1)];
}

/** Fixed-axis roll, pitch, yaw (rad) of the unit quaternion w, x, y, z, as REP-103 has them. */
export function eulerOfQuaternion(w: number, x: number, y: number, z: number): [number, number, number] {
  const norm = Math.hypot(w, x, y, z);
  if (!(norm > 1e-6)) return [Number.NaN, Number.NaN, Number.NaN];
  const [a, b, c, d] = [w / norm, x / norm, y / norm, z / norm];
  const sine = Math.max(-1, Math.min(1, 2 * (a * c - d * b)));
  return [
    Math.atan2(2 * (a * b + c * d), 1 - 2 * (b * b + c * c)),
    Math.asin(sine),
    Math.atan2(2 * (a * d + b * c), 1 - 2 * (c * c + d * d)),
  ];
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
  const angle = eulerOfQuaternion(w, x, y, z)[source.angle] ?? Number.NaN;
  return Number.isFinite(angle) ? angle : null;
}
