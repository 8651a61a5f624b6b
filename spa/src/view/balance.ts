/** The signs of balance; loaded on demand. */
import { BalanceOverlay } from '../overlays/balance/balance_overlay.ts';
import type { BalanceDrawing } from '../overlays/balance_drawing.ts';

export type { MakeBalance } from '../overlays/balance_drawing.ts';

/** Makes what draws the balance of one robot. */
export function makeBalance(): BalanceDrawing {
  return new BalanceOverlay();
}
