import { type Field, JOINT, type Schema } from '@posecast/wire';
import { isolated, placeOf } from '../names.ts';
import {
  invertQuat,
  multiplyQuats,
  normalizeQuat,
  type Quat,
  quatOfRpy,
  rpyOf,
  type Vec3,
  withoutHeading,
} from '../rotation.ts';
import { valueAt } from '../values.ts';

/** One inertial sensor: where it sits, and how it says it is turned. */
export interface Imu {
  readonly site: string;
  /** The plain name, when the profile has one. */
  readonly name: string;
  /** The link it sits on; null is the root link. */
  readonly link: string | null;
  readonly linkFromSensor: Quat;
  /** Metres, in the link's frame. */
  readonly xyz: Vec3;
  /** Whether it knows its heading: one that reports roll and pitch alone does not. */
  readonly heading: boolean;
  /** world_from_sensor of the newest reading; null is no reading. */
  worldFromSensor: Quat | null;
}

type Source = { field: Field; quat: readonly number[] } | { field: Field; roll: number; pitch: number };

/** The orientation sensors of a robot. `read` rewrites them in place. */
export class ImuTable {
  readonly imus: readonly Imu[];
  /** The one that says how the robot leans; null when none does. */
  readonly body: Imu | null;
  readonly #sources: readonly Source[];

  constructor(schema: Schema) {
    const found = new Map<string, { imu: Imu; source: Source }>();
    const add = (site: string, source: Source, heading: boolean) => {
      if (found.has(site)) return;
      const mount = schema.mapping.sensors.get(site);
      const imu: Imu = {
        site,
        name: isolated(mount?.name ?? site),
        link: mount?.link ?? null,
        linkFromSensor: quatOfRpy(mount?.rpy ?? [0, 0, 0]),
        xyz: mount?.xyz ?? [0, 0, 0],
        heading,
        worldFromSensor: null,
      };
      found.set(site, { imu, source });
    };
    const quat = orientation(schema, 'quat');
    for (const site of sitesOf(quat, 'w')) {
      const parts = ['w', 'x', 'y', 'z'].map((part) => placeOf(quat!.labels, `${site}.${part}`));
      if (!parts.includes(-1)) add(site, { field: quat!, quat: parts }, true);
    }
    const tilt = orientation(schema, 'tilt');
    for (const site of sitesOf(tilt, 'roll')) {
      const roll = placeOf(tilt!.labels, `${site}.roll`);
      const pitch = placeOf(tilt!.labels, `${site}.pitch`);
      if (pitch >= 0) add(site, { field: tilt!, roll, pitch }, false);
    }
    this.imus = [...found.values()].map(({ imu }) => imu);
    this.#sources = [...found.values()].map(({ source }) => source);
    // The profile's first one named as an IMU; a robot without a profile must have only one to leave no doubt.
    const named = [...schema.mapping.sensors].find(([site, { kind }]) => kind === 'imu' && found.has(site));
    const alone = schema.mapping.sensors.size === 0 && found.size === 1 ? this.imus[0] : undefined;
    this.body = (named === undefined ? alone : found.get(named[0])?.imu) ?? null;
  }

  read(codes: Int32Array): readonly Imu[] {
    this.imus.forEach((imu, i) => {
      imu.worldFromSensor = readSource(codes, this.#sources[i]!);
    });
    return this.imus;
  }
}

/**
 * world_from_root of a robot of which only one sensor knows how it is turned. `rootFromLink` is the sensor's link as
 * the joints have it. Of a sensor that does not know its heading, the robot faces along x.
 */
export function rootAttitude(imu: Imu, rootFromLink: Quat): Quat | null {
  if (imu.worldFromSensor === null) return null;
  const rootFromSensor = multiplyQuats(rootFromLink, imu.linkFromSensor);
  const worldFromRoot = normalizeQuat(multiplyQuats(imu.worldFromSensor, invertQuat(rootFromSensor)));
  if (worldFromRoot === null) return null;
  return imu.heading ? worldFromRoot : withoutHeading(worldFromRoot);
}

/** How the sensor's link leans: roll and pitch, rad; null is no reading. */
export function leanOf(imu: Imu): { roll: number; pitch: number } | null {
  if (imu.worldFromSensor === null) return null;
  const [roll, pitch] = rpyOf(multiplyQuats(imu.worldFromSensor, invertQuat(imu.linkFromSensor)));
  return { roll, pitch };
}

function orientation(schema: Schema, name: string): Field | null {
  const field = schema.field(name);
  return field === null || field.labelSet === JOINT ? null : field;
}

/** Sites of a field, by the component that every one of them must have. */
function sitesOf(field: Field | null, component: string): string[] {
  const end = `.${component}`;
  return (field?.labels ?? [])
    .filter((label) => label.endsWith(end))
    .map((label) => label.slice(0, -end.length));
}

function readSource(codes: Int32Array, source: Source): Quat | null {
  if ('quat' in source) {
    const [w, x, y, z] = source.quat.map((index) => valueAt(codes, source.field, index));
    if (w == null || x == null || y == null || z == null) return null;
    return normalizeQuat([w, x, y, z]);
  }
  const roll = valueAt(codes, source.field, source.roll);
  const pitch = valueAt(codes, source.field, source.pitch);
  return roll === null || pitch === null ? null : quatOfRpy([roll, pitch, 0]);
}
