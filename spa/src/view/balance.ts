/** The balance signs; loaded on demand. */
import { BalanceOverlay } from '../overlays/balance/balance_overlay.ts';
import { Facets } from '../overlays/balance/facets.ts';
import type { BalancePicture } from '../overlays/balance_drawing.ts';

/** Creates the object that draws the balance of all robots in one picture. */
export function makeBalance(): BalancePicture {
  const facets = new Facets();
  return {
    facets,
    begin: () => facets.begin(),
    end: () => facets.end(),
    addRobot: () => new BalanceOverlay(facets),
  };
}
