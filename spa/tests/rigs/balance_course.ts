import { parseSchema } from '@posecast/wire';
import { BalanceReader } from '../../src/model/balance/balance_reader.ts';
import { readManifest } from '../../src/model/manifest.ts';
import { captureTime } from '../../src/twin/balance/balancer.ts';
import { type ExpectedBalance, tellBalance } from './balance_vectors.ts';

/** A robot and its reports. */
interface Course {
  readonly manifest: Record<string, unknown>;
  readonly schema: string;
  readonly frames: readonly {
    readonly t: number;
    readonly codes: readonly number[];
    /** m/s of the centre of mass, to compute the capture point from it instead of from the page's own velocity, with the floor at
     *  0. */
    readonly velocity?: readonly number[];
  }[];
}

/** The page's balance for every frame, in the format of the vectors. */
export function readCourse({ manifest, schema, frames }: Course): {
  readonly frames: readonly (ExpectedBalance & { readonly captured: readonly number[] | null })[];
} {
  const reader = new BalanceReader(readManifest(manifest), parseSchema(schema));
  return {
    frames: frames.map(({ t, codes, velocity }) => {
      const told = structuredClone(tellBalance(reader.ofFrame(Int32Array.from(codes), t)));
      const centre = told.centre_of_mass_m;
      if (velocity === undefined || centre === null) return { ...told, captured: null };
      const ahead = captureTime(centre[2]!);
      return { ...told, captured: [centre[0]! + velocity[0]! * ahead, centre[1]! + velocity[1]! * ahead, 0] };
    }),
  };
}
