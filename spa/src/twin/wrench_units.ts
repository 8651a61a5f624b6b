/** What units of forces and moments are worth in SI. */

/** By what a value in a unit is multiplied to be in SI. */
export type UnitFactors = Readonly<Record<string, number>>;

export const FORCE_UNITS: UnitFactors = { N: 1, mN: 1e-3, kN: 1e3 };
export const TORQUE_UNITS: UnitFactors = { Nm: 1, mNm: 1e-3, Nmm: 1e-3, kNm: 1e3 };

/** By what a value in `unit` is multiplied to be in SI; null when the unit is not among these. A field without a unit is in
 *  its usual one, which is SI (SPEC §2); a product of newtons and metres may have a sign for it (`N·m`, `N*m`, `N.m`). */
export function factorAmong(factors: UnitFactors, unit: string): number | null {
  const name = unit.replace(/N[·*.](?=m)/, 'N');
  if (name === '') return 1;
  return Object.hasOwn(factors, name) ? factors[name]! : null;
}
