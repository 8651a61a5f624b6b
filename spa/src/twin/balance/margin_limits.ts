import { type Level, level, type Threshold } from '@posecast/wire';
import type { ValueLimits } from '../limits/limits.ts';

/** The name of the margin where limits and plots are stored by field and label. */
export const MARGIN = { field: 'balance', label: 'margin' } as const;

/** The source of the margin limits: the viewer, the profile, or the page's defaults if nobody has set any. */
export type LimitsOwner = 'viewer' | 'profile' | 'page';

/** The limits for caution and fault of the margin (mm). */
export interface MarginLimits {
  readonly owner: LimitsOwner;
  readonly levelAt: (marginMm: number) => Level;
  /** The threshold reported for a crossing, mm. */
  readonly threshold: Threshold;
}

/** Without explicit limits, the margin is amber below this, and red outside. */
export const CAUTION_BELOW_MM = 20;

const OF_PAGE: MarginLimits = {
  owner: 'page',
  levelAt: (marginMm) => (marginMm < 0 ? 'fault' : marginMm < CAUTION_BELOW_MM ? 'caution' : 'ok'),
  threshold: { low: 0, high: null, caution: 1 },
};

let ofPage: readonly [ValueLimits | null, MarginLimits] = [null, OF_PAGE];

/** The current limits of the margin; the same object as long as `limits` is the same. */
export function marginLimits(limits: ValueLimits | null): MarginLimits {
  if (limits !== ofPage[0]) ofPage = [limits, limitsFrom(limits)];
  return ofPage[1];
}

/** The limits that somebody has set. */
export function limitsBy(threshold: Threshold, owner: LimitsOwner): MarginLimits {
  return { owner, levelAt: (marginMm) => level(threshold, marginMm), threshold };
}

function limitsFrom(limits: ValueLimits | null): MarginLimits {
  const threshold = limits?.threshold(MARGIN.field, MARGIN.label) ?? null;
  if (limits === null || threshold === null) return OF_PAGE;
  return limitsBy(threshold, limits.edited(MARGIN.field, MARGIN.label) ? 'viewer' : 'profile');
}
