import { JOINT, type Schema } from '@posecast/wire';
import { quatOfRpy } from '../../../twin/rotation.ts';
import type { Quantity } from '../../../twin/si_units.ts';
import { type CdrWriter, utf8Of } from './cdr_writer.ts';
import {
  carriedBy,
  compute,
  type FrameTopic,
  NO_READING,
  type Reading,
  readingOf,
  stampedTopic,
  unlessEmpty,
  type WriteBody,
} from './frame_topic.ts';

/** The label suffixes (after the point) of a sensor field, in the order of the message, and the quantity that it measures. */
const PARTS = {
  quat: [['x', 'y', 'z', 'w'], 'part'],
  gyro: [['x', 'y', 'z'], 'rotation rate'],
  acc: [['x', 'y', 'z'], 'acceleration'],
  tilt: [['roll', 'pitch'], 'position'],
  ftf: [['fx', 'fy', 'fz'], 'force'],
  ftm: [['mx', 'my', 'mz'], 'torque'],
} as const satisfies Readonly<Record<string, readonly [readonly string[], Quantity]>>;
type SensorField = keyof typeof PARTS;
const IMU = ['quat', 'gyro', 'acc', 'tilt'] as const satisfies readonly SensorField[];
const WRENCH = ['ftf', 'ftm'] as const satisfies readonly SensorField[];

/** A covariance starting with this value means no reading; all zeros mean that the errors are unknown. */
const ABSENT = -1;

/** One topic for each site with an inertial sensor, and one for each with forces or moments. `rootLink`: the model's root, used
 *  for an inertial sensor without a link. */
export function sensorTopicsOf(schema: Schema, rootLink: string | null): FrameTopic[] {
  const topics: FrameTopic[] = [];
  const imus: string[] = [];
  for (const site of sitesOf(schema, IMU)) {
    imus.push(topicPart(site, imus));
    topics.push(...imuTopic(schema, site, `/imu/${imus.at(-1)}`, linkOf(schema, site, rootLink)));
  }
  const wrenches: string[] = [];
  for (const site of sitesOf(schema, WRENCH)) {
    wrenches.push(topicPart(site, wrenches));
    topics.push(...wrenchTopic(schema, site, `/wrench/${wrenches.at(-1)}`, linkOf(schema, site, rootLink)));
  }
  return topics;
}

/** A site's name as part of a topic name: letters, digits and _, not starting with a digit; numbered if another site has the
 *  same. */
function topicPart(site: string, taken: readonly string[]): string {
  const name = site.replace(/[^A-Za-z0-9_]/gu, '_').replace(/^(?=\d|$)/, '_');
  let part = name;
  for (let n = 2; taken.includes(part); n++) part = `${name}_${n}`;
  return part;
}

/** The sites of these fields in schema order, each once. */
function sitesOf(schema: Schema, names: readonly SensorField[]): string[] {
  const sites = new Set<string>();
  for (const { name, labels, labelSet, bits } of schema.fields) {
    const known = names.find((each) => each === name);
    if (known === undefined || labelSet === JOINT || bits.length > 0) continue;
    for (const label of labels) {
      const dot = label.lastIndexOf('.');
      const parts: readonly string[] = PARTS[known][0];
      if (dot > 0 && parts.includes(label.slice(dot + 1))) sites.add(label.slice(0, dot));
    }
  }
  return [...sites];
}

function readingsOf(schema: Schema, name: SensorField, site: string): readonly Reading[] {
  const [parts, quantity] = PARTS[name];
  const field = schema.field(name);
  if (field === null || field.labelSet === JOINT || field.bits.length > 0) return parts.map(() => NO_READING);
  return parts.map((part) => readingOf(schema, field, `${site}.${part}`, quantity));
}

/** The link that carries the sensor; if unspecified, the root for an IMU, else the site's own name. */
function linkOf(schema: Schema, site: string, rootLink: string | null): Uint8Array {
  const mount = schema.mapping.sensors.get(site);
  const isOnRoot = mount?.kind === 'imu' && rootLink !== null;
  return utf8Of(mount?.link ?? (isOnRoot ? rootLink : site));
}

function imuTopic(schema: Schema, site: string, name: string, link: Uint8Array): FrameTopic[] {
  const [quat, gyro, acc, tilt] = IMU.map((field) => readingsOf(schema, field, site)) as [
    readonly Reading[],
    readonly Reading[],
    readonly Reading[],
    readonly Reading[],
  ];
  // without a heading sensor, from roll and pitch
  const isTilt = unlessEmpty(quat) === null && unlessEmpty(tilt) !== null;
  const carried = carriedBy([...quat, ...gyro, ...acc]);
  if (carried.size === 0 && !isTilt) return [];
  const writeBody: WriteBody = (to, values) => {
    if (isTilt) writeTilt(to, tilt, values);
    else writeReadings(to, quat, values);
    for (const each of [gyro, acc]) writeReadings(to, each, values);
  };
  return [stampedTopic(name, 'sensor_msgs/msg/Imu', link, carried, writeBody)];
}

function wrenchTopic(schema: Schema, site: string, name: string, link: Uint8Array): FrameTopic[] {
  const readings = WRENCH.flatMap((field) => readingsOf(schema, field, site));
  const carried = carriedBy(readings);
  if (carried.size === 0) return [];
  const writeBody: WriteBody = (to, values) => {
    for (const reading of readings) to.f64(compute(reading, values));
  };
  return [stampedTopic(name, 'geometry_msgs/msg/WrenchStamped', link, carried, writeBody)];
}

/** Numbers and their covariance. */
function writeReadings(to: CdrWriter, readings: readonly Reading[], values: Float64Array): void {
  let isKnown = false;
  for (const reading of readings) {
    const value = compute(reading, values);
    isKnown ||= !Number.isNaN(value);
    to.f64(value);
  }
  writeCovariance(to, isKnown);
}

function writeTilt(to: CdrWriter, tilt: readonly Reading[], values: Float64Array): void {
  const [roll, pitch] = tilt.map((reading) => compute(reading, values)) as [number, number];
  const [w, x, y, z] = quatOfRpy([roll, pitch, 0]);
  for (const value of [x, y, z, w]) to.f64(value);
  writeCovariance(to, !Number.isNaN(roll) || !Number.isNaN(pitch));
}

function writeCovariance(to: CdrWriter, isKnown: boolean): void {
  to.f64(isKnown ? 0 : ABSENT);
  for (let i = 1; i < 9; i++) to.f64(0);
}
