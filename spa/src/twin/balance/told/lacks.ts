import type { Balance, BalanceGap } from '../balance.ts';

/** What of a robot's balance can't be known, whatever it does, or as long as its body isn't. `told`: what the model's doctor or its reader has found. */
export interface Lack {
  readonly why:
    | 'unreadable'
    | 'no-pressure'
    | Extract<
        BalanceGap,
        | 'old-bundle'
        | 'raw'
        | 'no-masses'
        | 'impossible-masses'
        | 'no-feet'
        | 'no-wrench'
        | 'orientation-unread'
        | 'joint-unread'
      >;
  readonly told?: string;
}

const TOLD: ReadonlySet<BalanceGap> = new Set([
  'old-bundle',
  'raw',
  'no-masses',
  'impossible-masses',
  'no-feet',
  'no-wrench',
  'orientation-unread',
  'joint-unread',
]);

/** What is lacking, each once. `balance`: null of a model's files as they are, which list no masses; `findings`: what
 *  the doctor says of masses; `problems`: what of model or profile can't be read. */
export function lacksOf(
  balance: Pick<Balance, 'gaps'> | null,
  findings: readonly unknown[],
  problems: readonly string[] = [],
): readonly Lack[] {
  if (balance === null) return [{ why: 'raw' }];
  const { centreOfMass, polygon, pressure } = balance.gaps;
  const whys = new Set([centreOfMass, polygon].filter((gap) => gap !== null && TOLD.has(gap)));
  const lacks = [...(whys as Set<Lack['why']>)].map((why): Lack => {
    const told = why === 'impossible-masses' ? findings : [];
    const text = told.find((one) => typeof one === 'string');
    return text === undefined ? { why } : { why, told: text };
  });
  if (pressure === 'no-wrench' && !whys.has(pressure)) lacks.push({ why: 'no-pressure' });
  return [...problems.map((told): Lack => ({ why: 'unreadable', told })), ...lacks];
}
