import { readFileSync } from 'node:fs';
import { parseSchema, type Schema } from '@posecast/wire';
import { type Manifest, readManifest } from '../../src/model/manifest.ts';
import type { Balance, BalanceGap } from '../../src/twin/balance/balance.ts';

/** From `wire/vectors/balance.json`; `wire/python/tools/make_balance_vectors.py` documents the format. */
export interface ExpectedBalance {
  readonly mass_kg: number;
  readonly centre_of_mass_m: readonly number[] | null;
  readonly velocity_mps: readonly number[] | null;
  readonly capture_point_m: readonly number[] | null;
  readonly floor_m: number | null;
  readonly ground: Balance['ground'];
  readonly support_polygon_m: readonly (readonly number[])[];
  readonly nearest_edge: number | null;
  readonly margin_m: number | null;
  readonly centre_of_pressure_m: readonly number[] | null;
  readonly feet: Readonly<
    Record<
      string,
      {
        readonly bears: boolean | null;
        readonly force_n: number | null;
        readonly centre_of_pressure_m: readonly number[] | null;
        readonly at_edge: boolean;
      }
    >
  >;
  readonly gaps: Readonly<Record<string, BalanceGap>>;
}

export interface BalanceFrame {
  readonly t: number;
  readonly codes: readonly number[];
  readonly balance: ExpectedBalance;
}

export interface BalanceCase {
  readonly name: string;
  readonly manifest: Manifest;
  readonly schema: Schema;
  readonly frames: readonly BalanceFrame[];
}

interface File {
  readonly model: Readonly<Record<string, unknown>>;
  readonly cases: readonly {
    readonly name: string;
    readonly changes: Readonly<Record<string, unknown>>;
    readonly schema: string;
    readonly frames: readonly BalanceFrame[];
  }[];
}

/** All cases. */
export function readBalanceCases(): readonly BalanceCase[] {
  const file = new URL('../../../wire/vectors/balance.json', import.meta.url);
  const { model, cases } = JSON.parse(readFileSync(file, 'utf8')) as File;
  return cases.map(({ name, changes, schema, frames }) => {
    const members = Object.entries({ ...model, ...changes }).filter(([, value]) => value !== null);
    return {
      name,
      manifest: readManifest(Object.fromEntries(members)),
      schema: parseSchema(schema),
      frames,
    };
  });
}

/** The result, in the format of the vectors. */
export function tellBalance(found: Balance): ExpectedBalance {
  const { gaps } = found;
  const named = {
    ...{ centre_of_mass: gaps.centreOfMass, polygon: gaps.polygon, margin: gaps.margin },
    ...{ pressure: gaps.pressure, capture_point: gaps.capturePoint },
  };
  return {
    mass_kg: found.massKg,
    centre_of_mass_m: found.centreOfMass,
    velocity_mps: found.velocity,
    capture_point_m: found.capturePoint,
    floor_m: found.floorM,
    ground: found.ground,
    support_polygon_m: found.polygon,
    nearest_edge: found.nearestEdge,
    margin_m: found.marginM,
    centre_of_pressure_m: found.pressure,
    feet: Object.fromEntries(
      found.feet.map(({ name, bears, forceN, pressure, atEdge }) => [
        name,
        { bears, force_n: forceN, centre_of_pressure_m: pressure, at_edge: atEdge },
      ]),
    ),
    gaps: Object.fromEntries(
      Object.entries(named).filter((entry): entry is [string, BalanceGap] => entry[1] !== null),
    ),
  };
}
