/** One problem in a model, in one line, with the wording of `posecast-edge doctor`. */
export interface Finding {
  /** `error`: something is wrong or not shown; `warning`: probably wrong; `hint`: could be better. */
  readonly severity: 'error' | 'warning' | 'hint';
  /** Identifies the rule for tools. */
  readonly code: string;
  readonly text: string;
  /** Line in the URDF; null if the finding has none. */
  readonly line: number | null;
}

/** Reports a finding. */
export type Say = (severity: Finding['severity'], code: string, text: string, line: number | null) => void;

/** The consequence of implausible or unknown masses. */
export const NO_BALANCE = 'no balance is shown';
const DISTRUST = 'mass-';

/** Whether a finding says that masses are implausible or unknown. */
export function distrustsMasses({ code }: Pick<Finding, 'code'>): boolean {
  return code.startsWith(DISTRUST);
}

/** Turns findings from `since` on about invalid numbers in a link's mass, centre or moments into a reason not to show balance. */
export function distrustMasses(findings: Finding[], since: number): void {
  for (let i = since; i < findings.length; i += 1) {
    const found = findings[i]!;
    if (found.code === 'number')
      findings[i] = { ...found, code: `${DISTRUST}number`, text: `${found.text}; ${NO_BALANCE}` };
  }
}

const RANK = { error: 0, warning: 1, hint: 2 } as const;
const MAX_FINDINGS = 200;

/** Sorts findings by severity, then line; drops duplicates, and everything beyond 200. */
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

/** Control characters, separators other than the plain space, and unassigned characters. */
const UNPRINTABLE = /(?! )[\p{C}\p{Z}]/u;

export function isPrintable(text: string): boolean {
  return !UNPRINTABLE.test(text);
}

/** Makes a name from an untrusted file safe to show: without control characters, and cut to `longest`. */
export function quoted(name: string, longest = 80): string {
  const characters = [...name.slice(0, 2 * longest + 2)];
  const shown = characters.map((c) => (isPrintable(c) ? c : '�'));
  return shown.length <= longest ? `'${shown.join('')}'` : `'${shown.slice(0, longest).join('')}…'`;
}

/** Formats a number like Python's `:g`. */
export function general(value: number, digits = 6): string {
  if (value === 0) return Object.is(value, -0) ? '-0' : '0';
  const [mantissa = '', power = '0'] = value.toExponential(digits - 1).split('e');
  const exponent = Number(power);
  const trimmed = (text: string) => (text.includes('.') ? text.replace(/\.?0+$/, '') : text);
  if (exponent >= -4 && exponent < digits) return trimmed(value.toFixed(Math.max(0, digits - 1 - exponent)));
  const sign = exponent < 0 ? '-' : '+';
  return `${trimmed(mantissa)}e${sign}${String(Math.abs(exponent)).padStart(2, '0')}`;
}
