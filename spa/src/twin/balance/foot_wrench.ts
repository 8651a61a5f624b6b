import { MISSING, type Schema } from '@posecast/wire';
import { placeOf } from '../names.ts';
import type { Vec3 } from '../rotation.ts';
import type { FootWrench } from './balance.ts';

/** The largest code of a reading. */
const CODE_MAX = -MISSING - 1;

interface Part {
  vector: Vec3 | null;
  readonly axes: readonly number[];
}

interface Source {
  readonly site: string;
  readonly part: Part;
  readonly kind: 'force' | 'moment';
  /** The index in the code vector, by axis. */
  readonly places: readonly number[];
  /** The value of a code in the channels' units. */
  readonly scale: number;
  /** By axis, the factor from the channel's unit to N or N·m; 0 if it is not measured. */
  readonly factors: readonly number[];
  readonly values: [number, number, number];
}

/** Reads the wrenches at some sites from frames' codes. A component that is not measured, or in an unknown unit, is 0; a code at
 *  its limit counts as no reading. */
export class FootWrenchReader {
  /** In the order of the sites; sites without any component are left out. */
  readonly wrenches: readonly FootWrench[];
  readonly #sources: Source[] = [];

  constructor(schema: Schema, sites: Iterable<string>) {
    this.wrenches = [...sites].flatMap((site) => {
      const force = this.#part(schema, site, 'force', 'f', FORCE_UNITS);
      const moment = this.#part(schema, site, 'moment', 'm', TORQUE_UNITS);
      return force.axes.length + moment.axes.length === 0 ? [] : [{ site, force, moment }];
    });
  }

  /** Updates `wrenches`. */
  read(codes: Int32Array): readonly FootWrench[] {
    return this.#take(({ places, scale }, axis) => (codes[places[axis]!] ?? MISSING) * scale);
  }

  /** Updates `wrenches` from others of the same schema whose numbers are still in their channels' units. */
  convert(played: readonly FootWrench[]): readonly FootWrench[] {
    return this.#take(
      (source, axis) => played.find(({ site }) => site === source.site)?.[source.kind].vector?.[axis],
    );
  }

  #take(readingOf: (source: Source, axis: number) => number | undefined): readonly FootWrench[] {
    for (const source of this.#sources) {
      const { part, factors, scale, values } = source;
      part.vector = values;
      for (const axis of part.axes) {
        const value = readingOf(source, axis) ?? Number.NaN;
        // A reading at the limit may be larger than its code can express.
        if (!(Math.abs(value) < CODE_MAX * scale)) part.vector = null;
        values[axis] = value * factors[axis]!;
      }
    }
    return this.wrenches;
  }

  #part(schema: Schema, site: string, kind: Source['kind'], letter: string, units: UnitFactors): Part {
    const field = schema.field(`ft${letter}`);
    if (field === null) return { vector: null, axes: [] };
    const { name, labels, start, unit, scale } = field;
    const found = ['x', 'y', 'z'].map((axis) => placeOf(labels, `${site}.${letter}${axis}`));
    const factors = found.map((place) =>
      place < 0 ? 0 : (factorAmong(units, schema.mapping.unit(name, labels[place]!) ?? unit) ?? 0),
    );
    const part: Part = { vector: null, axes: [0, 1, 2].filter((axis) => factors[axis]! > 0) };
    const places = found.map((place) => start + place);
    if (part.axes.length > 0)
      this.#sources.push({ site, part, kind, places, scale, factors, values: [0, 0, 0] });
    return part;
  }
}

/** Conversion of force and moment units to SI. */

/** The factor that converts a unit to SI. */
export type UnitFactors = Readonly<Record<string, number>>;

export const FORCE_UNITS: UnitFactors = { N: 1, mN: 1e-3, kN: 1e3 };
export const TORQUE_UNITS: UnitFactors = { Nm: 1, mNm: 1e-3, Nmm: 1e-3, kNm: 1e3 };

/** The factor that converts a value in `unit` to SI; null if the unit is not in this list. A field without a unit is in its
 *  default one, which is SI (SPEC §2); a product of newtons and metres may be written with a sign (`N·m`, `N*m`, `N.m`). */
export function factorAmong(factors: UnitFactors, unit: string): number | null {
  const name = unit.replace(/N[·*.](?=m)/, 'N');
  if (name === '') return 1;
  return Object.hasOwn(factors, name) ? factors[name]! : null;
}
