/** One thing that is wrong with a model, in the words of `posecast-edge doctor`: one finding, one line. */
export interface Finding {
  /** `error`: something is not shown, or wrong; `warning`: probably wrong. */
  readonly severity: 'error' | 'warning' | 'hint';
  /** Names the rule for tools. */
  readonly code: string;
  readonly text: string;
  /** In the URDF; null when it has none. */
  readonly line: number | null;
}

const RANK = { error: 0, warning: 1, hint: 2 } as const;
const MAX_FINDINGS = 200;

/** By severity, then line; each only once, at most 200. */
export function worstFirst(findings: readonly Finding[]): Finding[] {
  const unique = new Map(findings.map((one) => [JSON.stringify(one), one]));
  const order = (a: string, b: string) => (a < b ? -1 : a > b ? 1 : 0);
  return [...unique.values()]
    .sort(
      (a, b) =>
        RANK[a.severity] - RANK[b.severity] ||
        (a.line ?? 0) - (b.line ?? 0) ||
        order(a.code, b.code) ||
        order(a.text, b.text),
    )
    .slice(0, MAX_FINDINGS);
}

/** Control characters, separators but the plain space, and what no font has. */
const UNPRINTABLE = /(?! )[\p{C}\p{Z}]/u;

export function isPrintable(text: string): boolean {
  return !UNPRINTABLE.test(text);
}

/** A name from a stranger's file, safe to show: no control characters, not endless. */
export function quoted(name: string, longest = 80): string {
  const characters = [...name.slice(0, 2 * longest + 2)];
  const shown = characters.map((c) => (isPrintable(c) ? c : '�'));
  return shown.length <= longest ? `'${shown.join('')}'` : `'${shown.slice(0, longest).join('')}…'`;
}

/** A number as Python's `:g` writes it. */
export function general(value: number, digits = 6): string {
  if (value === 0) return Object.is(value, -0) ? '-0' : '0';
  const [mantissa = '', power = '0'] = value.toExponential(digits - 1).split('e');
  const exponent = Number(power);
  const trimmed = (text: string) => (text.includes('.') ? text.replace(/\.?0+$/, '') : text);
  if (exponent >= -4 && exponent < digits) return trimmed(value.toFixed(Math.max(0, digits - 1 - exponent)));
  const sign = exponent < 0 ? '-' : '+';
  return `${trimmed(mantissa)}e${sign}${String(Math.abs(exponent)).padStart(2, '0')}`;
}
