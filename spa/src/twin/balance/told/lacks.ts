import type { Balance, BalanceGap } from '../balance.ts';

/** What of a robot's balance can't be known, whatever it does. `told`: what the model's doctor or its reader has found. */
export interface Lack {
  readonly why:
    | 'unreadable'
    | 'no-pressure'
    | Extract<BalanceGap, 'old-bundle' | 'raw' | 'no-masses' | 'impossible-masses' | 'no-feet' | 'no-wrench'>;
  readonly told?: string;
}

const LASTING: ReadonlySet<BalanceGap> = new Set([
  'old-bundle',
  'raw',
  'no-masses',
  'impossible-masses',
  'no-feet',
  'no-wrench',
]);

/** What is lacking for good, each once. `balance`: null of a model's files as they are, which list no masses; `findings`: what
 *  the doctor says of masses; `problems`: what of model or profile can't be read. */
export function lacksOf(
  balance: Pick<Balance, 'gaps'> | null,
  findings: readonly unknown[],
  problems: readonly string[] = [],
): readonly Lack[] {
  if (balance === null) return [{ why: 'raw' }];
  const { centreOfMass, polygon, pressure } = balance.gaps;
  const whys = new Set([centreOfMass, polygon].filter((gap) => gap !== null && LASTING.has(gap)));
  const lacks = [...(whys as Set<Lack['why']>)].map((why): Lack => {
    const told = why === 'impossible-masses' ? findings : [];
    const text = told.find((one) => typeof one === 'string');
    return text === undefined ? { why } : { why, told: text };
  });
  if (pressure === 'no-wrench' && !whys.has(pressure)) lacks.push({ why: 'no-pressure' });
  return [...problems.map((told): Lack => ({ why: 'unreadable', told })), ...lacks];
}
