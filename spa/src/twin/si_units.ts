/** What the units that robots report are worth in SI, by the quantity they measure. A field without a unit is in its usual
 *  one, which is SI (SPEC §2). */

const DEGREE = Math.PI / 180;
const ROTATION = { rad: 1, deg: DEGREE, '°': DEGREE };
const LENGTH = { m: 1, cm: 1e-2, mm: 1e-3 };
const ROTATION_RATE = { 'rad/s': 1, 'deg/s': DEGREE, '°/s': DEGREE, rpm: (2 * Math.PI) / 60 };
const SPEED = { 'm/s': 1, 'cm/s': 1e-2, 'mm/s': 1e-3 };
const FORCE = { N: 1, mN: 1e-3, kN: 1e3 };
const TORQUE = {
  ...{ N·m: 1, Nm: 1, 'N*m': 1, 'N.m': 1 },
  ...{ mN·m: 1e-3, mNm: 1e-3, N·mm: 1e-3, Nmm: 1e-3 },
  ...{ kN·m: 1e3, kNm: 1e3 },
};
const ACCELERATION = {
  ...{ 'm/s²': 1, 'm/s2': 1, 'm/s^2': 1 },
  ...{ 'mm/s²': 1e-3, 'mm/s2': 1e-3, 'mm/s^2': 1e-3 },
  g: 9.80665,
};
const USUAL = { '': 1 };

const FACTORS = {
  position: { ...USUAL, ...ROTATION, ...LENGTH },
  velocity: { ...USUAL, ...ROTATION_RATE, ...SPEED },
  effort: { ...USUAL, ...TORQUE, ...FORCE },
  'rotation rate': { ...USUAL, ...ROTATION_RATE },
  acceleration: { ...USUAL, ...ACCELERATION },
  force: { ...USUAL, ...FORCE },
  torque: { ...USUAL, ...TORQUE },
  /** Of a quaternion. */
  part: USUAL,
} as const;

export type Quantity = keyof typeof FACTORS;

/** By what a value in `unit` is multiplied to be in SI (rad, m, s, N and products of them); null when the unit is none of
 *  this quantity, or not known here. */
export function factorOf(quantity: Quantity, unit: string): number | null {
  const factors: Readonly<Record<string, number>> = FACTORS[quantity];
  return Object.hasOwn(factors, unit) ? factors[unit]! : null;
}
