import type { Balance, BalanceGap } from '../balance.ts';

/** What of a robot's balance can't be known, whatever it does. `told`: what the model's doctor has found, if it has. */
export interface Lack {
  readonly why: 'raw' | Extract<BalanceGap, 'old-bundle' | 'no-masses' | 'impossible-masses' | 'no-feet'>;
  readonly told?: string;
}

const LASTING: ReadonlySet<BalanceGap> = new Set(['old-bundle', 'no-masses', 'impossible-masses', 'no-feet']);

interface Finding {
  readonly code: string;
  readonly text: string;
}

/** What is lacking for good, each once; `possible`: something can be known all the same. */
export function lacksOf(
  { gaps }: Pick<Balance, 'gaps'>,
  findings: readonly Finding[],
): { readonly lacks: readonly Lack[]; readonly possible: boolean } {
  const [mass, feet] = [gaps.centreOfMass, gaps.polygon].map((gap) =>
    gap !== null && LASTING.has(gap) ? (gap as Lack['why']) : null,
  );
  const whys = new Set([mass, feet].filter((why) => why != null));
  const lacks = [...whys].map((why): Lack => {
    const found = why === 'impossible-masses' ? findings.find(({ code }) => isAboutMass(code)) : undefined;
    return found === undefined ? { why } : { why, told: found.text };
  });
  return { lacks, possible: mass == null || feet == null };
}

/** The codes of the doctor's findings about masses: docs/MODEL.md. */
function isAboutMass(code: string): boolean {
  return code.startsWith('mass') || code.startsWith('inertia');
}
