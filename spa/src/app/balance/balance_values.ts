import type { Balance } from '../../twin/balance/balance.ts';
import { MARGIN } from '../../twin/balance/margin_channel.ts';
import type { BalanceText } from '../text/balance.ts';

/** A balance number that can be listed and plotted. */
export interface BalanceValue {
  readonly field: string;
  readonly label: string;
  readonly name: keyof BalanceText & ('margin' | 'massX' | 'massY' | 'massZ' | 'pressureX' | 'pressureY');
  readonly unit: 'mm' | 'm';
  /** The key of its explanation. */
  readonly explain: string;
}

const { field } = MARGIN;

/** The balance numbers, in the order `writeValues` uses. */
export const VALUES: readonly BalanceValue[] = [
  { ...MARGIN, name: 'margin', unit: 'mm', explain: 'balance.margin' },
  { field, label: 'mass.x', name: 'massX', unit: 'm', explain: 'balance.mass' },
  { field, label: 'mass.y', name: 'massY', unit: 'm', explain: 'balance.mass' },
  { field, label: 'mass.z', name: 'massZ', unit: 'm', explain: 'balance.mass' },
  { field, label: 'pressure.x', name: 'pressureX', unit: 'm', explain: 'balance.pressure' },
  { field, label: 'pressure.y', name: 'pressureY', unit: 'm', explain: 'balance.pressure' },
];

/** Writes the numbers of one balance result: the margin in mm, the rest in metres in world coordinates; NaN where unknown. */
export function writeValues({ marginM, centreOfMass, pressure }: Balance, into: Float64Array): void {
  into[0] = marginM === null ? Number.NaN : marginM * 1000;
  for (let i = 0; i < 3; i += 1) into[1 + i] = centreOfMass?.[i] ?? Number.NaN;
  for (let i = 0; i < 2; i += 1) into[4 + i] = pressure?.[i] ?? Number.NaN;
}
