import type { Level } from '@posecast/wire';
import type { Vec3 } from '../twin/rotation.ts';

/** Most labels at one time, so that a robot with 200 deviating joints does not fill the picture with words. */
export const MOST_LABELS = 16;
/** Distance of a label from its point, CSS px. */
const BESIDE_PX = 10;
const LINE_PX = 21;
/** Estimated width of a letter, CSS px: measuring the text would force a layout in every tick. */
const LETTER_PX = 6.7;
const FRAME_PX = 28;

/** Projects a point of the world to the picture, CSS px; null behind the camera. */
export type LabelPlace = (at: Vec3) => { x: number; y: number } | null;

export interface OverlayLabel {
  /** Identifies the same label in successive pictures. */
  readonly key: string;
  readonly text: string;
  readonly level: Level;
  /** Shown without emphasis, because it is no trouble: a joint that yields on purpose, or has no reading. */
  readonly quiet: boolean;
  /** The point that it belongs to (world, metres). */
  readonly at: Vec3;
}

/** The overlay's labels as HTML elements over the canvas, so that they are sharp, cost no draw call and follow the
 *  theme. Screen readers find the same in the table. */
export class OverlayLabels {
  readonly #layer = document.createElement('div');
  readonly #elements = new Map<string, { root: HTMLElement; text: Text; at: Vec3; shownAt: string }>();

  constructor(host: HTMLElement) {
    this.#layer.className = 'sign-labels';
    this.#layer.setAttribute('aria-hidden', 'true');
    host.append(this.#layer);
  }

  /** Sets the labels, the most important first. */
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

  /** Places the labels in a picture of this width (CSS px), to the right of their points if there is room, else left.
   *  */
  place(place: LabelPlace, width: number): void {
    const taken: { x: number; y: number }[] = [];
    for (const element of this.#elements.values()) {
      const point = place(element.at);
      const x = besideAt(point?.x ?? 0, element.text.length * LETTER_PX + FRAME_PX, width);
      let y = Math.round(point?.y ?? 0);
      // Move it below any label that is in the way; there are few.
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

/** The left edge of a label of width `wide` beside a point at x, CSS px. */
export function besideAt(x: number, wide: number, width: number): number {
  const right = Math.round(x) + BESIDE_PX;
  if (right + wide <= width) return right;
  return Math.max(0, Math.round(x - BESIDE_PX - wide));
}
