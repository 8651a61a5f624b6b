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

/** One inertial sensor: where it is mounted, and its reported orientation. */
export interface Imu {
  readonly site: string;
  /** The plain name if the profile has one, else the site. */
  readonly name: string;
  /** The link it is mounted on; null is the root link. */
  readonly link: string | null;
  readonly linkFromSensor: Quat;
  /** Its position in the link's frame, metres. */
  readonly xyz: Vec3;
  /** Whether it reports a heading; one with only roll and pitch does not. */
  readonly heading: boolean;
  /** world_from_sensor of the newest reading; null is no reading. */
  worldFromSensor: Quat | null;
}

type Source = { field: Field; quat: readonly number[] } | { field: Field; roll: number; pitch: number };

/** The orientation sensors of a robot. `read` rewrites them in place. */
export class ImuTable {
  readonly imus: readonly Imu[];
  /** The sensor of the robot's lean; null if there is none, or if there are several and no profile. */
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
    // The profile's first IMU; without sensors in the profile, the robot's only one.
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
 * world_from_root from one orientation sensor. `rootFromLink` is the rotation of the sensor's link given the joint angles. If the
 * sensor reports no heading, the robot faces along the world's x axis. null without a reading.
 */
export function rootAttitude(imu: Imu, rootFromLink: Quat): Quat | null {
  if (imu.worldFromSensor === null) return null;
  const rootFromSensor = multiplyQuats(rootFromLink, imu.linkFromSensor);
  const worldFromRoot = normalizeQuat(multiplyQuats(imu.worldFromSensor, invertQuat(rootFromSensor)));
  if (worldFromRoot === null) return null;
  return imu.heading ? worldFromRoot : withoutHeading(worldFromRoot);
}

/** Roll and pitch of the sensor's link, rad; null without a reading. */
export function leanOf(imu: Imu): { roll: number; pitch: number } | null {
  if (imu.worldFromSensor === null) return null;
  const [roll, pitch] = rpyOf(multiplyQuats(imu.worldFromSensor, invertQuat(imu.linkFromSensor)));
  return { roll, pitch };
}

function orientation(schema: Schema, name: string): Field | null {
  const field = schema.field(name);
  return field === null || field.labelSet === JOINT ? null : field;
}

/** The sites of a field whose labels are SITE.COMPONENT; every site has the given component. */
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
