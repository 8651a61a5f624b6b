import type { Balance } from '../../twin/balance/balance.ts';
import type { Vec3 } from '../../twin/rotation.ts';

const METRE_DECIMALS = 4;
const MM_DECIMALS = 1;

/** The CSV columns for balance, after those of the channels. */
export const BALANCE_COLUMNS: readonly string[] = [
  ...['x', 'y', 'z'].map((axis) => `balance.centre_of_mass.${axis} [m]`),
  ...['x', 'y'].map((axis) => `balance.capture_point.${axis} [m]`),
  ...['x', 'y'].map((axis) => `balance.centre_of_pressure.${axis} [m]`),
  'balance.floor [m]',
  'balance.margin [mm]',
];

/** Their cells; empty if there is no value. */
export function balanceCells(balance: Balance | null): readonly string[] {
  if (balance === null) return BALANCE_COLUMNS.map(() => '');
  const { centreOfMass, capturePoint, pressure, floorM, marginM } = balance;
  return [
    ...pointCells(centreOfMass, 3),
    ...pointCells(capturePoint, 2),
    ...pointCells(pressure, 2),
    cell(floorM, METRE_DECIMALS),
    cell(marginM === null ? null : 1000 * marginM, MM_DECIMALS),
  ];
}

function pointCells(point: Vec3 | null, axes: number): string[] {
  return Array.from({ length: axes }, (_, axis) => cell(point?.[axis] ?? null, METRE_DECIMALS));
}

/** Without a minus sign before zero. */
function cell(value: number | null, decimals: number): string {
  return value?.toFixed(decimals).replace(/^-(?=[0.]+$)/, '') ?? '';
}
