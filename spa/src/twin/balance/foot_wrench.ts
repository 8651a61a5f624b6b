import { type Field, MISSING, type Schema } from '@posecast/wire';
import { placeOf } from '../names.ts';
import type { Vec3 } from '../rotation.ts';
import { factorOf } from '../si_units.ts';
import type { FootWrench } from './standing.ts';

/** The largest code of a reading. */
const CODE_MAX = -MISSING - 1;

type Of = 'force' | 'torque';

interface Part {
  vector: Vec3 | null;
  readonly axes: readonly number[];
}

interface Source {
  readonly site: string;
  readonly part: Part;
  readonly isForce: boolean;
  /** For each measured axis, its place in the code vector. */
  readonly places: readonly number[];
  /** For each measured axis, what a code is worth in N or N·m. */
  readonly steps: readonly number[];
  /** By axis, what a value in its channel's unit is worth in N or N·m; 0 for one that is not measured. */
  readonly factors: readonly number[];
  /** The largest value of its channels, in their units: a reading there may be more than its code can say. */
  readonly most: number;
  readonly values: [number, number, number];
}

/** Reads the wrenches of some sites from frames' codes, without allocating. A component that a sensor does not measure, or
 *  in a unit that nobody knows, is 0; one at the limit of its code is no reading. */
export class FootWrenchReader {
  /** In the order of the sites; those without any component are left out. */
  readonly wrenches: readonly FootWrench[];
  readonly #sources: Source[] = [];

  constructor(schema: Schema, sites: Iterable<string>) {
    this.wrenches = [...sites].flatMap((site) => {
      const force = this.#part(schema, 'ftf', site, ['fx', 'fy', 'fz'], 'force');
      const moment = this.#part(schema, 'ftm', site, ['mx', 'my', 'mz'], 'torque');
      return force.axes.length + moment.axes.length === 0 ? [] : [{ site, force, moment }];
    });
  }

  /** Rewrites `wrenches`. */
  read(codes: Int32Array): readonly FootWrench[] {
    for (const { part, places, steps, values } of this.#sources) {
      part.vector = values;
      for (let i = 0; i < places.length; i += 1) {
        const code = codes[places[i]!] ?? MISSING;
        if (Math.abs(code) >= CODE_MAX) part.vector = null;
        else values[part.axes[i]!] = code * steps[i]!;
      }
    }
    return this.wrenches;
  }

  /** Rewrites `wrenches` by others of the same schema whose numbers are still in their channels' units. */
  convert(played: readonly FootWrench[]): readonly FootWrench[] {
    for (const { site, part, isForce, factors, most, values } of this.#sources) {
      const wrench = played.find((one) => one.site === site);
      const vector = (isForce ? wrench?.force : wrench?.moment)?.vector ?? null;
      const known = vector?.every((value) => Math.abs(value) < most) ?? false;
      part.vector = known ? values : null;
      for (let axis = 0; vector !== null && axis < 3; axis += 1)
        values[axis] = factors[axis] === 0 ? 0 : vector[axis]! * factors[axis]!;
    }
    return this.wrenches;
  }

  #part(schema: Schema, name: string, site: string, components: readonly string[], quantity: Of): Part {
    const field = schema.field(name);
    const found = components.map((component) =>
      field === null ? -1 : placeOf(field.labels, `${site}.${component}`),
    );
    const factors = found.map((place) =>
      field === null || place < 0 ? 0 : worth(schema, field, place, quantity),
    );
    const axes = [0, 1, 2].filter((axis) => factors[axis]! > 0);
    const part: Part = { vector: null, axes };
    if (field !== null && axes.length > 0) {
      const places = axes.map((axis) => field.start + found[axis]!);
      const steps = axes.map((axis) => factors[axis]! * field.scale);
      const most = CODE_MAX * field.scale;
      const isForce = quantity === 'force';
      this.#sources.push({ site, part, isForce, places, steps, factors, most, values: [0, 0, 0] });
    }
    return part;
  }
}

/** What a value of a channel is worth in N or N·m; 0 in a unit that is none of these, or that nobody knows. */
function worth({ mapping }: Schema, { name, labels, unit }: Field, place: number, quantity: Of): number {
  return factorOf(quantity, mapping.unit(name, labels[place]!) ?? unit) ?? 0;
}
