import { type Field, MISSING, type Schema } from '@posecast/wire';
import { placeOf } from '../names.ts';
import type { Vec3 } from '../rotation.ts';

/** A wrench as far as balance needs it; one of `WrenchTable` fits. */
export interface FootWrench {
  readonly site: string;
  /** N in the sensor's axes; null without a reading. `axes`: those that are measured (0 x, 1 y, 2 z). */
  readonly force: { readonly vector: Vec3 | null; readonly axes: readonly number[] };
  /** N·m, likewise. */
  readonly moment: { readonly vector: Vec3 | null; readonly axes: readonly number[] };
}

interface Part {
  vector: Vec3 | null;
  readonly axes: readonly number[];
}

interface Source {
  readonly part: Part;
  readonly field: Field;
  /** For each measured axis, its place in the code vector. */
  readonly places: readonly number[];
  readonly values: [number, number, number];
}

/** Reads the wrenches of some sites from frames' codes, without allocating. A component that a sensor does not measure
 *  is 0. */
export class FootWrenchReader {
  /** In the order of the sites; those without any component are left out. */
  readonly wrenches: readonly FootWrench[];
  readonly #sources: Source[] = [];

  constructor(schema: Schema, sites: Iterable<string>) {
    this.wrenches = [...sites].flatMap((site) => {
      const force = this.#part(schema, 'ftf', site, ['fx', 'fy', 'fz']);
      const moment = this.#part(schema, 'ftm', site, ['mx', 'my', 'mz']);
      return force.axes.length + moment.axes.length === 0 ? [] : [{ site, force, moment }];
    });
  }

  /** Rewrites `wrenches`. */
  read(codes: Int32Array): readonly FootWrench[] {
    for (const { part, field, places, values } of this.#sources) {
      part.vector = values;
      for (let i = 0; i < places.length; i += 1) {
        const code = codes[places[i]!] ?? MISSING;
        if (code === MISSING) part.vector = null;
        else values[part.axes[i]!] = code * field.scale;
      }
    }
    return this.wrenches;
  }

  #part(schema: Schema, name: string, site: string, components: readonly string[]): Part {
    const field = schema.field(name);
    const found = components.map((component) =>
      field === null ? -1 : placeOf(field.labels, `${site}.${component}`),
    );
    const axes = [0, 1, 2].filter((axis) => found[axis]! >= 0);
    const part: Part = { vector: null, axes };
    if (field !== null && axes.length > 0) {
      const places = axes.map((axis) => field.start + found[axis]!);
      this.#sources.push({ part, field, places, values: [0, 0, 0] });
    }
    return part;
  }
}
