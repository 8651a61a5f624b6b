/** The balance signs; loaded on demand. */

import type { BalancePicture } from '../balance_drawing.ts';
import { BalanceOverlay } from './balance_overlay.ts';
import { Facets } from './shapes.ts';

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
