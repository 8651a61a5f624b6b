import { parseSchema } from '@posecast/wire';
import { BalanceReader } from '../../src/model/balance/balance_reader.ts';
import { readManifest } from '../../src/model/manifest.ts';
import { LimitLog } from '../../src/twin/alarms/limit_log.ts';
import { captureTime } from '../../src/twin/balance/balancer.ts';
import { MARGIN, marginLimits, StanceJudge } from '../../src/twin/balance/stance.ts';
import { ValueLimits } from '../../src/twin/limits.ts';
import { type ExpectedBalance, tellBalance } from './balance_vectors.ts';

/** A robot and its reports, seconds and codes. */
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
export function readBalance({ manifest, schema, frames }: Course): {
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

/** The page's report for every frame, and the recorded crossings of the default limits. */
export function readStances({ manifest, schema: text, frames }: Course) {
  const schema = parseSchema(text);
  const reader = new BalanceReader(readManifest(manifest), schema);
  const [judge, log] = [new StanceJudge(), new LimitLog()];
  const limits = marginLimits(new ValueLimits(schema.mapping));
  const stances = frames.map(({ t, codes }) => {
    const balance = reader.ofFrame(Int32Array.from(codes), t);
    const stance = judge.next(balance, reader.headingRad, limits);
    if (stance !== null && stance.marginMm !== null) {
      const reading = { ...MARGIN, name: 'margin', unit: 'mm', value: stance.marginMm, level: stance.level };
      log.note('Balance', reading, limits.threshold, t * 1000, false);
    }
    return stance;
  });
  const { owner, threshold } = limits;
  return { stances, crossings: log.crossings, owner, threshold };
}
