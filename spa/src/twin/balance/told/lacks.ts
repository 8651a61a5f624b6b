import type { Balance, BalanceGap } from '../balance.ts';

/** What of a robot's balance can't be known, whatever it does. `told`: what the model's doctor or its reader has found. */
export interface Lack {
  readonly why:
    | 'unreadable'
    | Extract<BalanceGap, 'old-bundle' | 'raw' | 'no-masses' | 'impossible-masses' | 'no-feet'>;
  readonly told?: string;
}

const LASTING: ReadonlySet<BalanceGap> = new Set([
  'old-bundle',
  'raw',
  'no-masses',
  'impossible-masses',
  'no-feet',
]);

/** What is lacking for good, each once; `possible`: something can be known all the same. `findings`: the manifest's member, as it
 *  came; `problems`: what of model or profile can't be read. */
export function lacksOf(
  { gaps }: Pick<Balance, 'gaps'>,
  findings: unknown,
  problems: readonly string[] = [],
): { readonly lacks: readonly Lack[]; readonly possible: boolean } {
  const [mass, feet] = [gaps.centreOfMass, gaps.polygon].map((gap) =>
    gap !== null && LASTING.has(gap) ? (gap as Lack['why']) : null,
  );
  const whys = new Set([mass, feet].filter((why) => why != null));
  const lacks = [...whys].map((why): Lack => {
    const told = why === 'impossible-masses' ? toldOfMasses(findings) : undefined;
    return told === undefined ? { why } : { why, told };
  });
  const unread = problems.map((told): Lack => ({ why: 'unreadable', told }));
  return { lacks: [...unread, ...lacks], possible: mass == null || feet == null };
}

/** What the doctor says of masses that can't be: the first finding with such a code (docs/MODEL.md). */
function toldOfMasses(findings: unknown): string | undefined {
  if (!Array.isArray(findings)) return undefined;
  for (const finding of findings) {
    const { code, text } = (finding ?? {}) as { code?: unknown; text?: unknown };
    if (typeof code === 'string' && /^(mass|inertia)/.test(code) && typeof text === 'string') return text;
  }
  return undefined;
}
