import { jointOfLinks, type PosedBody } from '../../model/posed_body.ts';
import type { Load } from '../../twin/sensors/load.ts';
import { loadColor, NO_LOAD } from './colors.ts';

/** Paints each link by the load of the joint that moves it; links fixed to it get the same colour. */
export class JointLoadPaint {
  #figure: PosedBody | null = null;
  /** Link → the joint that moves it, or null. */
  #jointOf: ReadonlyMap<string, string | null> = new Map();
  readonly #shown = new Map<string, number>();

  /** The displayed colours by link (sRGB 0xrrggbb); empty while links have their own. */
  get shown(): ReadonlyMap<string, number> {
    return this.#shown;
  }

  /** Paints the links; `fault` is the colour (sRGB) of a joint past its limit, which is also hatched. True if any changed. */
  paint(figure: PosedBody | null, loads: ReadonlyMap<string, Load> | null, fault: number): boolean {
    if (figure !== this.#figure) {
      this.#figure = figure;
      this.#jointOf = figure === null ? new Map() : jointOfLinks(figure);
      this.#shown.clear();
    }
    if (figure === null) return false;
    let changed = false;
    for (const [link, joint] of this.#jointOf) {
      if (loads === null) {
        if (!this.#shown.delete(link)) continue;
        figure.setTint(link, null);
        changed = true;
        continue;
      }
      const load = joint === null ? undefined : loads.get(joint);
      const color = colorOf(load, fault);
      if (this.#shown.get(link) === color) continue;
      this.#shown.set(link, color);
      figure.setTint(link, { color, hatched: load?.level === 'fault' });
      changed = true;
    }
    return changed;
  }
}

function colorOf(load: Load | undefined, fault: number): number {
  if (load === undefined || load.part === null) return NO_LOAD;
  return load.level === 'fault' ? fault : loadColor(load.part);
}
