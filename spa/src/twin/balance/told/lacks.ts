import type { Balance, BalanceGap } from '../balance.ts';

/** Gaps that last; the others pass with the robot's next poses. */
const LASTING = [
  'old-bundle',
  'raw',
  'no-masses',
  'impossible-masses',
  'no-feet',
  'no-wrench',
  'orientation-unread',
  'joint-unread',
] as const satisfies readonly BalanceGap[];

/** What of a robot's balance can't be known, whatever it does, or as long as its body isn't. `told`: what the model's doctor or its reader has found. */
export interface Lack {
  readonly why: 'unreadable' | 'no-pressure' | (typeof LASTING)[number];
  readonly told?: string;
}

/** What is lacking, each once. `balance`: null of a model's files as they are, which list no masses; `findings`: what
 *  the doctor says of masses; `problems`: what of model or profile can't be read. */
export function lacksOf(
  balance: Pick<Balance, 'gaps'> | null,
  findings: readonly unknown[],
  problems: readonly string[] = [],
): readonly Lack[] {
  if (balance === null) return [{ why: 'raw' }];
  const { centreOfMass, polygon, pressure } = balance.gaps;
  const whys = new Set([centreOfMass, polygon].filter(isLasting));
  const lacks = [...whys].map((why): Lack => {
    const told = why === 'impossible-masses' ? findings : [];
    const text = told.find((one) => typeof one === 'string');
    return text === undefined ? { why } : { why, told: text };
  });
  if (pressure === 'no-wrench' && !whys.has(pressure)) lacks.push({ why: 'no-pressure' });
  return [...problems.map((told): Lack => ({ why: 'unreadable', told })), ...lacks];
}

function isLasting(gap: BalanceGap | null): gap is (typeof LASTING)[number] {
  return LASTING.some((one) => one === gap);
}
