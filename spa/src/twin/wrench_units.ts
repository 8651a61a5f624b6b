/** Conversion of force and moment units to SI. */

/** The factor that converts a unit to SI. */
export type UnitFactors = Readonly<Record<string, number>>;

export const FORCE_UNITS: UnitFactors = { N: 1, mN: 1e-3, kN: 1e3 };
export const TORQUE_UNITS: UnitFactors = { Nm: 1, mNm: 1e-3, Nmm: 1e-3, kNm: 1e3 };

/** The factor that converts a value in `unit` to SI; null if the unit is not in this list. A field without a unit is in its
 *  default one, which is SI (SPEC §2); a product of newtons and metres may be written with a sign (`N·m`, `N*m`, `N.m`). */
export function factorAmong(factors: UnitFactors, unit: string): number | null {
  const name = unit.replace(/N[·*.](?=m)/, 'N');
  if (name === '') return 1;
  return Object.hasOwn(factors, name) ? factors[name]! : null;
}
