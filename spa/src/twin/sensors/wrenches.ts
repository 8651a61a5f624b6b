import type { Field, Level, Schema, SensorMount, Threshold } from '@posecast/wire';
import { LevelLatch, type ValueLimits, worseOf } from '../limits.ts';
import { isolated, placeOf } from '../names.ts';
import type { Vec3 } from '../rotation.ts';
import { valueAt } from '../values.ts';

/** `Arrow.much` for a sensor without limits in the profile. */
const MUCH = { force: 500, moment: 20 } as const; // N, N·m

/** A force or a moment at one site, in the sensor's axes. */
export interface Arrow {
  /** N or N·m; null if the robot measures none, or if one of its components has no reading now. */
  vector: Vec3 | null;
  /** The highest level of its components. */
  level: Level;
  /** The axes that the robot measures (0 x, 1 y, 2 z), so that a lone z component is not mistaken for the whole force. */
  readonly axes: readonly number[];
  /** The size (N or N·m) that counts as large: the profile's farthest limit. Arrow lengths are relative to it. */
  readonly much: number;
}

/** One force-torque sensor. */
export interface Wrench {
  readonly site: string;
  readonly name: string;
  readonly mount: SensorMount;
  readonly force: Arrow;
  readonly moment: Arrow;
}

interface Source {
  arrow: Arrow;
  field: Field;
  /** For each measured axis: index in the field, label, latch. */
  parts: readonly { axis: number; index: number; label: string; latch: LevelLatch }[];
}

/** The force-torque sensors mounted on a link. `read` overwrites them in place. */
export class WrenchTable {
  readonly wrenches: readonly Wrench[];
  readonly #sources: Source[] = [];

  constructor(schema: Schema) {
    const sites = [...schema.mapping.sensors].filter(([, mount]) => mount.link !== null);
    this.wrenches = sites.flatMap(([site, mount]) => {
      const force = this.#arrow(schema, 'ftf', site, ['fx', 'fy', 'fz'], MUCH.force);
      const moment = this.#arrow(schema, 'ftm', site, ['mx', 'my', 'mz'], MUCH.moment);
      if (force.axes.length === 0 && moment.axes.length === 0) return [];
      return [{ site, name: isolated(mount.name), mount, force, moment }];
    });
  }

  read(codes: Int32Array, limits: ValueLimits): readonly Wrench[] {
    for (const { arrow, field, parts } of this.#sources) {
      const vector: [number, number, number] = [0, 0, 0];
      let whole = true;
      arrow.level = 'ok';
      for (const { axis, index, label, latch } of parts) {
        const value = valueAt(codes, field, index);
        arrow.level = worseOf(arrow.level, latch.next(limits.threshold(field.name, label), value));
        if (value === null) whole = false;
        else vector[axis] = value;
      }
      arrow.vector = whole ? vector : null;
    }
    return this.wrenches;
  }

  #arrow(schema: Schema, name: string, site: string, components: readonly string[], much: number): Arrow {
    const field = schema.field(name);
    const parts = components
      .map((component, axis) => ({ axis, label: `${site}.${component}`, latch: new LevelLatch() }))
      .map((part) => ({ ...part, index: field === null ? -1 : placeOf(field.labels, part.label) }))
      .filter(({ index }) => index >= 0);
    const limits = parts.map(({ label }) => schema.mapping.threshold(name, label));
    const farthest = Math.max(0, ...limits.map(reach));
    const arrow: Arrow = {
      vector: null,
      level: 'ok',
      axes: parts.map(({ axis }) => axis),
      much: farthest > 0 ? farthest : much,
    };
    if (field !== null && parts.length > 0) this.#sources.push({ arrow, field, parts });
    return arrow;
  }
}

function reach(threshold: Threshold | null): number {
  return Math.max(Math.abs(threshold?.low ?? 0), Math.abs(threshold?.high ?? 0));
}
