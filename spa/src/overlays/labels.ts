import type { Level } from '@posecast/wire';
import type { Vec3 } from '../twin/rotation.ts';

/** Labels at one time; a robot of 200 joints that all deviate must not fill the picture with words. */
export const MOST_LABELS = 16;
/** From the point a label belongs to, CSS px. */
const BESIDE_PX = 10;
const LINE_PX = 21;
/** How wide words are, about: asking the page would make it lay itself out in every tick. */
const LETTER_PX = 6.7;
const FRAME_PX = 28;

/** Where a point of the world is in the picture, CSS px; null behind the eye. */
export type LabelPlace = (at: Vec3) => { x: number; y: number } | null;

export interface OverlayLabel {
  /** The same label from picture to picture. */
  readonly key: string;
  readonly text: string;
  readonly level: Level;
  /** Yields on purpose, or has no reading: said, but no trouble. */
  readonly quiet: boolean;
  /** World. */
  readonly at: Vec3;
}

/** Words beside the signs: elements over the canvas, so that they are sharp, cost no draw call and follow the theme.
 *  Screen readers find the same in the table, as text. */
export class OverlayLabels {
  readonly #layer = document.createElement('div');
  readonly #elements = new Map<string, { root: HTMLElement; text: Text; at: Vec3; shownAt: string }>();

  constructor(host: HTMLElement) {
    this.#layer.className = 'sign-labels';
    this.#layer.setAttribute('aria-hidden', 'true');
    host.append(this.#layer);
  }

  /** The labels there are now, the most important first. */
  set(labels: readonly OverlayLabel[]): void {
    const shown = labels.slice(0, MOST_LABELS);
    const keys = new Set(shown.map(({ key }) => key));
    for (const [key, { root }] of this.#elements) {
      if (keys.has(key)) continue;
      root.remove();
      this.#elements.delete(key);
    }
    for (const { key, text, level, quiet, at } of shown) {
      const element = this.#elements.get(key) ?? this.#make(key);
      if (element.text.data !== text) element.text.data = text;
      const { dataset } = element.root;
      if (dataset.level !== level) dataset.level = level;
      if (dataset.quiet !== String(quiet)) dataset.quiet = String(quiet);
      element.at = at;
    }
  }

  /** Puts them where their points are in a picture of this width, CSS px: beside them at the right, else at the left. */
  place(place: LabelPlace, width: number): void {
    const taken: { x: number; y: number }[] = [];
    for (const element of this.#elements.values()) {
      const point = place(element.at);
      const x = besideAt(point?.x ?? 0, element.text.length * LETTER_PX + FRAME_PX, width);
      let y = Math.round(point?.y ?? 0);
      // Below one that is in the way; those of one body are few.
      if (point !== null) {
        for (const other of taken) {
          if (Math.abs(other.x - x) < 90 && Math.abs(other.y - y) < LINE_PX) y = other.y + LINE_PX;
        }
        taken.push({ x, y });
      }
      const at = point === null ? '' : `translate(${x}px, ${y}px) translateY(-50%)`;
      if (element.shownAt === at) continue;
      element.shownAt = at;
      element.root.style.transform = at;
      element.root.hidden = point === null;
    }
  }

  dispose(): void {
    this.#layer.remove();
    this.#elements.clear();
  }

  #make(key: string) {
    const root = document.createElement('div');
    root.className = 'sign-label';
    root.dataset.sign = key;
    const text = document.createTextNode('');
    root.append(document.createElement('i'), text);
    this.#layer.append(root);
    const element = { root, text, at: [0, 0, 0] as Vec3, shownAt: 'never' };
    this.#elements.set(key, element);
    return element;
  }
}

/** Where words of this width begin beside a point, CSS px. */
export function besideAt(x: number, wide: number, width: number): number {
  const right = Math.round(x) + BESIDE_PX;
  if (right + wide <= width) return right;
  return Math.max(0, Math.round(x - BESIDE_PX - wide));
}
