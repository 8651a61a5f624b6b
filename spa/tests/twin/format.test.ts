import { describe, expect, it } from 'vitest';
import { displayOf, flagWords, formatNumber, formatSpan, stepsOf, stepsText } from '../../src/twin/format.ts';

const shown = (value: number | null, unit: string, angle: 'rad' | 'deg' = 'rad') =>
  formatNumber(value, displayOf(unit, angle));

describe('numbers', () => {
  it('have the decimals of their unit', () => {
    expect(shown(0.3814, 'rad')).toBe('\u20070.381');
    expect(shown(0.3814, 'rad', 'deg')).toBe('\u200721.9');
    expect(shown(1.5, 'm')).toBe('\u20071.500');
    expect(shown(120.04, 'N')).toBe('\u2007120.0');
    expect(shown(38, 'C')).toBe('\u200738.0');
    expect(shown(1.239, 'A')).toBe('\u20071.24');
    expect(displayOf('1', 'deg')).toEqual({ unit: '', decimals: 3, factor: 1 }); // a part of a quaternion
  });

  it('keep the sign in a column of its own, with a true minus', () => {
    expect(shown(-0.381, 'rad')).toBe('\u22120.381');
    expect(shown(-0.381, 'rad').length).toBe(shown(0.381, 'rad').length);
  });

  it('are the same text exactly where they are the same number of steps', () => {
    const rad = displayOf('rad', 'rad');
    for (const value of [0.0005, 0.38149, 1.9995, 12.3456, 999.9996, 1e9, 1e14, 1e17, 3e22]) {
      for (const signed of [value, -value]) {
        const text = formatNumber(signed, rad);
        const shownAs = Number(text.replace('\u2212', '-').replace('\u2007', ''));
        expect(Math.abs(shownAs - signed), text).toBeLessThanOrEqual(0.000_500_1 + Math.abs(signed) * 1e-15);
        expect(stepsText(stepsOf(signed, rad), rad)).toBe(text.replace('\u2007', ''));
      }
    }
    expect(stepsOf(0.3811, rad)).toBe(stepsOf(0.3809, rad));
    expect(formatNumber(0.000012, displayOf('lux', 'rad', 1e-5))).toBe('\u20070.00001');
  });

  it('have no sign when they round to zero', () => {
    expect(shown(-0.0004, 'rad')).toBe('\u20070.000');
    expect(shown(-0.0006, 'rad')).toBe('\u22120.001');
    expect(shown(-0, 'A')).toBe('\u20070.00');
  });

  it('are a dash when there is no reading', () => {
    for (const none of [null, Number.NaN, Number.POSITIVE_INFINITY]) expect(shown(none, 'rad')).toBe('—');
  });

  it('of a unit nobody knows take their decimals from the scale', () => {
    expect(displayOf('lux', 'rad', 0.01)).toEqual({ unit: 'lux', decimals: 2, factor: 1 });
    expect(displayOf('lux', 'rad', 0.05).decimals).toBe(2);
    expect(displayOf('', 'rad', 1).decimals).toBe(0);
    expect(displayOf('', 'rad', 25).decimals).toBe(0);
  });

  it('turn degrees only where an angle is meant', () => {
    expect(displayOf('rad/s', 'deg').unit).toBe('°/s');
    expect(displayOf('m', 'deg').unit).toBe('m');
    expect(displayOf('Nm', 'deg').unit).toBe('N·m');
  });
});

it('spans of time read as a person says them', () => {
  const spans = [0, 38.4, 999, 1000, 3249, 9949, 12_000, 119_000, 120_000, 3_600_000, 7_200_000];
  expect(spans.map(formatSpan)).toEqual([
    '0 ms',
    '38 ms',
    '999 ms',
    '1.0 s',
    '3.2 s',
    '9.9 s',
    '12 s',
    '119 s',
    '2 min',
    '60 min',
    '2 h',
  ]);
  expect(formatSpan(-5)).toBe('0 ms');
});

it('flags are named in words', () => {
  expect(
    ['jam', 'pwmSaturated', 'motorFail0', 'posMaxError', 'bit 17', 'source_lost', 'above 70 °C'].map(
      flagWords,
    ),
  ).toEqual([
    'jam',
    'PWM saturated',
    'motor fail 0',
    'pos max error',
    'bit 17',
    'source lost',
    'above 70 °C',
  ]);
});
