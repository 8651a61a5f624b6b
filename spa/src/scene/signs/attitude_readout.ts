import type { AngleUnit } from '../../twin/format.ts';
import { displayOf, formatNumber } from '../../twin/format.ts';
import type { ShownAttitude } from './attitude.ts';

const SVG = 'http://www.w3.org/2000/svg';
/** The lean (rad) at which the bubble of the spirit level reaches the rim. */
const FULL_RAD = 0.35;
const RIM = 11;

type Lean = Pick<ShownAttitude, 'roll' | 'pitch'> & { readonly angle: AngleUnit; readonly old: boolean };

/** Shows roll and pitch as numbers and as the bubble of a spirit level, in the host's element for them. */
export class AttitudeReadout {
  /** The element in the host; hidden without a reading. */
  readonly root = document.createElement('div');
  readonly #bubble = document.createElementNS(SVG, 'circle');
  readonly #roll = document.createTextNode('');
  readonly #pitch = document.createTextNode('');

  constructor(host: HTMLElement) {
    this.root.className = 'stage-level';
    this.root.dataset.testid = 'level';
    this.root.hidden = true;
    const glass = document.createElementNS(SVG, 'svg');
    glass.setAttribute('viewBox', '-17 -17 34 34');
    glass.setAttribute('aria-hidden', 'true');
    for (const r of [16, 5]) {
      const ring = document.createElementNS(SVG, 'circle');
      ring.setAttribute('r', String(r));
      ring.setAttribute('class', 'glass');
      glass.append(ring);
    }
    this.#bubble.setAttribute('r', '4.5');
    this.#bubble.setAttribute('class', 'bubble');
    glass.append(this.#bubble);
    const list = document.createElement('dl');
    for (const [name, text] of [
      ['roll', this.#roll],
      ['pitch', this.#pitch],
    ] as const) {
      const term = document.createElement('dt');
      term.textContent = name;
      const value = document.createElement('dd');
      value.append(text);
      list.append(term, value);
    }
    this.root.append(glass, list);
    host.append(this.root);
  }

  /** Shows a lean, or that there is no reading now; null hides the readout (the robot has no such sensor). */
  show(lean: Lean | null): void {
    this.root.hidden = lean === null;
    if (lean === null) return;
    const { roll, pitch, angle, old } = lean;
    this.root.dataset.old = String(old);
    const display = displayOf('rad', angle);
    const unit = angle === 'deg' ? '°' : ' rad';
    const said = (value: number | null) => formatNumber(value, display) + (value === null ? '' : unit);
    for (const [text, value] of [
      [this.#roll, roll],
      [this.#pitch, pitch],
    ] as const) {
      const words = said(value);
      if (text.data !== words) text.data = words;
    }
    // A bubble moves to the high side: to the left if the robot leans right, back if it leans forward.
    const way = Math.hypot(roll ?? 0, pitch ?? 0);
    const part = way === 0 ? 0 : (Math.min(1, way / FULL_RAD) * RIM) / way;
    this.#bubble.setAttribute(
      'transform',
      `translate(${(-(roll ?? 0) * part).toFixed(1)} ${((pitch ?? 0) * part).toFixed(1)})`,
    );
    this.#bubble.setAttribute('visibility', roll === null ? 'hidden' : 'visible');
  }

  dispose(): void {
    this.root.remove();
  }
}
