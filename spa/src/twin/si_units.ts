/** Conversion of the units that robots report to SI, by the quantity measured. */

import { FORCE_UNITS, factorAmong, TORQUE_UNITS, type UnitFactors } from './wrench_units.ts';

const DEGREE = Math.PI / 180;
const ROTATION = { rad: 1, deg: DEGREE, '°': DEGREE };
const LENGTH = { m: 1, cm: 1e-2, mm: 1e-3 };
const ROTATION_RATE = { 'rad/s': 1, 'deg/s': DEGREE, '°/s': DEGREE, rpm: (2 * Math.PI) / 60 };
const SPEED = { 'm/s': 1, 'cm/s': 1e-2, 'mm/s': 1e-3 };
const ACCELERATION = {
  ...{ 'm/s²': 1, 'm/s2': 1, 'm/s^2': 1 },
  ...{ 'mm/s²': 1e-3, 'mm/s2': 1e-3, 'mm/s^2': 1e-3 },
  g: 9.80665,
};

const FACTORS = {
  position: { ...ROTATION, ...LENGTH },
  velocity: { ...ROTATION_RATE, ...SPEED },
  effort: { ...TORQUE_UNITS, ...FORCE_UNITS },
  'rotation rate': ROTATION_RATE,
  acceleration: ACCELERATION,
  force: FORCE_UNITS,
  torque: TORQUE_UNITS,
  /** Of a quaternion. */
  part: {},
} as const satisfies Readonly<Record<string, UnitFactors>>;

export type Quantity = keyof typeof FACTORS;

/** The factor that converts a value in `unit` to SI (rad, m, s, N and products of them); null if the unit is unknown or does not
 *  measure this quantity. */
export function factorOf(quantity: Quantity, unit: string): number | null {
  return factorAmong(FACTORS[quantity], unit);
}
