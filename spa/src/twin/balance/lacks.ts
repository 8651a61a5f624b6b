import type { Schema } from '@posecast/wire';
import type { Balance, BalanceGap } from './balance.ts';

/** Permanent gaps; the others pass with the robot's next poses. */
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

/** The permanently unknown parts of a robot's balance, or those unknown until its body has loaded. `told`: the findings of the
 *  model's doctor or reader. */
export interface Lack {
  readonly why: 'unreadable' | 'no-pressure' | (typeof LASTING)[number];
  readonly told?: string;
}

/** The missing parts, each once. `balance`: null for raw model files, which list no masses; `findings`: the doctor's findings
 *  about masses; `problems`: the parts of model or profile that can't be read. */
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

/** Whether a robot may stand on two feet that measure their forces, judging only by its schema; the model has the final word. */
export function couldStand(schema: Schema | null): boolean {
  const sensors = [...(schema?.mapping.sensors.values() ?? [])];
  return sensors.filter(({ kind, link }) => kind === 'wrench' && link !== null).length > 1;
}

/** The doctor's findings about implausible masses: the texts of the findings with such a code
 *  (docs/reference/model-bundle.md). */
export function toldOfMasses(findings: unknown): unknown[] {
  if (!Array.isArray(findings)) return [];
  return findings.flatMap((finding) => {
    const { code, text } = (finding ?? {}) as { code?: unknown; text?: unknown };
    return typeof code === 'string' && /^(mass|inertia)/.test(code) ? [text] : [];
  });
}
