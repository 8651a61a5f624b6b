import { parseSchema } from '@posecast/wire';
import { BalanceReader } from '../../src/model/balance/balance_reader.ts';
import { readManifest } from '../../src/model/manifest.ts';
import { LimitLog } from '../../src/twin/alarms/limit_log.ts';
import { MARGIN, marginLimits } from '../../src/twin/balance/margin_limits.ts';
import { StanceJudge } from '../../src/twin/balance/stance.ts';
import { ValueLimits } from '../../src/twin/limits/limits.ts';

/** A robot and its reports, seconds and codes. */
interface Course {
  readonly manifest: Record<string, unknown>;
  readonly schema: string;
  readonly frames: readonly { readonly t: number; readonly codes: readonly number[] }[];
}

/** The page's report for every frame, and the recorded crossings of the default limits. */
export function readCourse({ manifest, schema: text, frames }: Course) {
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
