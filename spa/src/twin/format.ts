/** Numbers and units as a person reads them. Values arrive in the schema's units; degrees exist only here. */

import { isolated } from './names.ts';

export type AngleUnit = 'rad' | 'deg';

/** U+2212, as wide as a plus sign, so that the sign has a column of its own. */
const MINUS = '\u2212';
/** Figure space: exactly one digit wide, in place of the sign of a positive number. */
const NO_SIGN = '\u2007';
export const NO_READING = '—';

const DEGREES = 180 / Math.PI;

/** How numbers of one unit are shown: a value times `factor`, with this many decimals, followed by `unit`. */
export interface Display {
  unit: string;
  decimals: number;
  factor: number;
}

const DISPLAYS: Readonly<Record<string, Omit<Display, 'factor'>>> = {
  rad: { unit: 'rad', decimals: 3 },
  m: { unit: 'm', decimals: 3 },
  mm: { unit: 'mm', decimals: 1 },
  'rad/s': { unit: 'rad/s', decimals: 2 },
  'm/s': { unit: 'm/s', decimals: 3 },
  'm/s2': { unit: 'm/s²', decimals: 2 },
  A: { unit: 'A', decimals: 2 },
  V: { unit: 'V', decimals: 2 },
  W: { unit: 'W', decimals: 1 },
  N: { unit: 'N', decimals: 1 },
  Nm: { unit: 'N·m', decimals: 2 },
  'N.m': { unit: 'N·m', decimals: 2 },
  N·m: { unit: 'N·m', decimals: 2 },
  C: { unit: '°C', decimals: 1 },
  degC: { unit: '°C', decimals: 1 },
  '°C': { unit: '°C', decimals: 1 },
  '%': { unit: '%', decimals: 0 },
  1: { unit: '', decimals: 3 },
};

/** How a quantity in `unit` is shown. `scale` (value of one code) decides for units this page does not know. */
export function displayOf(unit: string, angle: AngleUnit, scale = 0.001): Display {
  if (angle === 'deg' && unit === 'rad') return { unit: '°', decimals: 1, factor: DEGREES };
  if (angle === 'deg' && unit === 'rad/s') return { unit: '°/s', decimals: 1, factor: DEGREES };
  const known = DISPLAYS[unit];
  const decimals = scale > 0 && scale < 1 ? Math.min(6, Math.ceil(-Math.log10(scale) - 1e-9)) : 0;
  if (known === undefined) return { unit: isolated(unit), decimals, factor: 1 };
  // Metres of a prismatic joint are shown in tenths of a millimetre, those of a base are not.
  return {
    ...known,
    decimals: unit === 'm' ? Math.max(known.decimals, Math.min(decimals, 4)) : known.decimals,
    factor: 1,
  };
}

/** How a deviation is shown in text: two decimals are enough, or millimetres for metres. */
export function coarseDisplay(display: Display): Display {
  return { ...display, decimals: Math.min(display.decimals, display.unit === 'm' ? 3 : 2) };
}

/** A number with its sign in a separate column; `null` and NaN are no reading. */
export function formatNumber(value: number | null, display: Display): string {
  const steps = stepsOf(value, display);
  const text = stepsText(steps, display);
  return steps >= 0 && text !== NO_READING ? NO_SIGN + text : text;
}

/** 10⁰ … 10⁶: the maximum number of decimals ever shown. */
const POWERS = [1, 10, 100, 1e3, 1e4, 1e5, 1e6] as const;

/** The value as a whole number of steps of the last shown digit; NaN is no reading. Values with equal steps look the
 *  same, so a table can skip formatting what it already shows. */
export function stepsOf(value: number | null, { decimals, factor }: Display): number {
  if (value === null) return Number.NaN;
  const steps = Math.abs(value * factor) * (POWERS[decimals] ?? 1);
  // Beyond 1e15 a double has no useful decimals, and rounding would only blur it. A value that rounds to zero gets no
  // sign, so that no minus flickers.
  const whole = steps < 1e15 ? Math.round(steps) : steps;
  return value < 0 && whole !== 0 ? -whole : whole;
}

/** ".000" … ".999" for each number of decimals, made on first use. */
const FRACTIONS: (readonly string[])[] = [];

/** The text for a number of steps (see `stepsOf`), without room for a sign: right-aligned numbers don't need it, and
 *  browsers lay out a purely Latin text faster. */
export function stepsText(steps: number, { decimals }: Display): string {
  if (!Number.isFinite(steps)) return NO_READING;
  const sign = steps < 0 ? MINUS : '';
  const size = Math.abs(steps);
  const power = POWERS[decimals] ?? 1;
  if (size >= 1e15) return sign + (size / power).toFixed(decimals);
  if (decimals === 0) return sign + size;
  const whole = Math.floor(size / power);
  return sign + whole + fractionOf(size - whole * power, decimals, power);
}

function fractionOf(part: number, decimals: number, power: number): string {
  if (decimals > 3) return `.${String(part).padStart(decimals, '0')}`;
  FRACTIONS[decimals] ??= Array.from({ length: power }, (_, i) => `.${String(i).padStart(decimals, '0')}`);
  return FRACTIONS[decimals][part]!;
}

/** A duration in words: "38 ms", "3.2 s", "12 s", "4 min", "2 h". */
export function formatSpan(spanMs: number): string {
  const ms = Math.max(0, spanMs);
  if (ms < 1000) return `${Math.round(ms)} ms`;
  if (ms < 9950) return `${(ms / 1000).toFixed(1)} s`;
  if (ms < 119_500) return `${Math.round(ms / 1000)} s`;
  if (ms < 7_170_000) return `${Math.round(ms / 60_000)} min`;
  return `${Math.round(ms / 3_600_000)} h`;
}

/** Time of day, "14:02". */
export function formatClock(epochMs: number): string {
  const at = new Date(epochMs);
  return `${String(at.getHours()).padStart(2, '0')}:${String(at.getMinutes()).padStart(2, '0')}`;
}

export function formatClockSeconds(epochMs: number): string {
  return `${formatClock(epochMs)}:${String(new Date(epochMs).getSeconds()).padStart(2, '0')}`;
}

/** "pwmSaturated" → "PWM saturated"; "motorFail0" → "motor fail 0". Unknown words stay as the robot says them. */
export function flagWords(name: string): string {
  if (name.includes(' ')) return isolated(name); // already words
  const words = name
    .replace(/([a-z])([A-Z])/g, '$1 $2')
    .replace(/([A-Za-z])(\d)/g, '$1 $2')
    .replace(/_/g, ' ')
    .toLowerCase();
  return isolated(words).replace(/\b(pwm|imu|can|ft|cpu)\b/g, (short) => short.toUpperCase());
}
