import type { Hello } from '@posecast/wire';

/** How far what is shown lies behind now, ms: so late is all that this audience is shown. null: not at all. */
export function behindMsOf({ limits }: Hello): number | null {
  const delayS = limits.get('delay_s') ?? 0;
  return delayS > 0 ? 1000 * delayS : null;
}
