import { type Line, noteLines } from '../../browser/drawn_lines.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { type Box, type LabelBox, LabelLayout, type LabelRoom } from './label_layout.ts';
import type { SignLabel } from './sign.ts';

/** Maximum number of labels, so that a robot with 200 deviating joints does not fill the picture with text. */
export const MOST_LABELS = 16;
/** Estimated size of a label that cannot be measured, CSS px. */
const LETTER_PX = 6.7;
const FRAME_PX = 28;
const HIGH_PX = 19;
/** The interval at which the positions of other text are read, ms: reading forces a layout. */
const LOOK_EVERY_MS = 500;

/** Projects a point of the world to the picture, CSS px; null behind the camera. */
export type LabelPlace = (at: Vec3) => { x: number; y: number } | null;

/** A label of one robot among all of a picture. */
export interface OverlayLabel extends SignLabel {
  readonly middle: Vec3;
  /** Shown in grey, like its strokes: the pose is out of date. */
  readonly old: boolean;
}

interface LabelElement {
  readonly root: HTMLElement;
  readonly text: Text;
  readonly leader: HTMLElement;
  label: OverlayLabel | null;
  shownAt: string;
  leads: string;
  /** Its size, CSS px, and the text length at its measurement: measuring at every tick would force a layout each time. */
  size: { readonly wide: number; readonly high: number };
  letters: number;
}

/** The overlay's labels as HTML elements over the canvas, so that they are sharp, cost no draw call and follow the theme. Screen
 *  readers get the same data from the table. */
export class OverlayLabels {
  readonly #layer = document.createElement('div');
  readonly #elements = new Map<string, LabelElement>();
  readonly #layout = new LabelLayout();
  readonly #words: HTMLElement;
  #room = '';
  #taken: readonly Box[] = [];
  #lookedMs = Number.NEGATIVE_INFINITY;

  /** `words`: an element over the same picture that no label may cover. */
  constructor(host: HTMLElement, words: HTMLElement) {
    this.#words = words;
    this.#layer.className = 'sign-labels';
    this.#layer.setAttribute('aria-hidden', 'true');
    host.append(this.#layer);
  }

  /** Sets the labels, the most important first. */
  set(labels: readonly OverlayLabel[]): void {
    const shown = labels.slice(0, MOST_LABELS);
    const keys = new Set(shown.map(({ key }) => key));
    for (const [key, { root, leader }] of this.#elements) {
      if (keys.has(key)) continue;
      root.remove();
      leader.remove();
      this.#elements.delete(key);
    }
    for (const label of shown) {
      const { key, text, level, quiet = false, old, explain } = label;
      const element = this.#elements.get(key) ?? this.#make(key);
      if (element.text.data !== text) element.text.data = text;
      const { dataset } = element.root;
      if (dataset.level !== level) {
        dataset.level = level;
        element.letters = -1; // with a different mark, or on a phone none at all
      }
      if (dataset.quiet !== String(quiet)) dataset.quiet = String(quiet);
      if (dataset.old !== String(old)) dataset.old = String(old);
      const explains = explain.join(' ');
      if (dataset.explains !== explains) dataset.explains = explains;
      element.label = label;
    }
  }

  /** Places the labels in a picture, so that they cover neither each other nor what they name. */
  place(place: LabelPlace, room: LabelRoom): void {
    const size = `${room.width} ${room.height}`;
    if (size !== this.#room) for (const element of this.#elements.values()) element.letters = -1;
    this.#room = size;
    const nowMs = performance.now();
    const boxes: LabelBox[] = [];
    const lines: Line[] = [];
    for (const [key, element] of this.#elements) {
      const { at, middle, lines: drawn } = element.label!;
      const own: Line[] = [];
      for (const [from, to] of drawn) {
        const line = [place(from), place(to)] as const;
        if (line[0] !== null && line[1] !== null) own.push([line[0], line[1]]);
      }
      noteLines(element.root, own, nowMs);
      lines.push(...own);
      const point = place(at);
      if (point === null || point.x < 0 || point.y < 0 || point.x > room.width || point.y > room.height)
        continue;
      const { wide, high } = measured(element);
      if (wide > 0) boxes.push({ key, wide, high, point, middle: place(middle)?.x ?? room.width / 2 });
    }
    const placed = this.#layout.place(boxes, lines, room, this.#listTaken(nowMs));
    for (const [key, element] of this.#elements) {
      const found = placed.get(key);
      const at = found === undefined ? '' : `translate(${found.x}px, ${found.y}px)`;
      if (element.shownAt !== at) {
        element.shownAt = at;
        element.root.style.transform = at;
        element.root.hidden = found === undefined;
      }
      drawLeader(element, found?.leader ?? null);
    }
  }

  dispose(): void {
    this.#layer.remove();
    this.#elements.clear();
  }

  #listTaken(nowMs: number): readonly Box[] {
    if (nowMs - this.#lookedMs < LOOK_EVERY_MS) return this.#taken;
    this.#lookedMs = nowMs;
    const { left, top } = this.#layer.getBoundingClientRect();
    const words = this.#words.getBoundingClientRect();
    const box = {
      ...{ left: words.left - left, top: words.top - top },
      ...{ right: words.right - left, bottom: words.bottom - top },
    };
    this.#taken = words.width > 0 ? [box] : [];
    return this.#taken;
  }

  #make(key: string) {
    const root = document.createElement('div');
    root.className = 'sign-label';
    root.dataset.sign = key;
    const text = document.createTextNode('');
    root.append(document.createElement('i'), text);
    const leader = document.createElement('b');
    leader.hidden = true;
    this.#layer.append(leader, root);
    const size = { wide: 0, high: 0 };
    const element: LabelElement = {
      ...{ root, text, leader, label: null, shownAt: 'never', leads: '', size, letters: -1 },
    };
    this.#elements.set(key, element);
    return element;
  }
}

/** The size of a label, measured if the length of its text has changed; zero for a label that the page hides. */
function measured(element: LabelElement): { readonly wide: number; readonly high: number } {
  const { root, text } = element;
  if (element.letters === text.length) return element.size;
  element.letters = text.length;
  const hidden = root.hidden;
  root.hidden = false;
  const [wide, high] = [root.offsetWidth, root.offsetHeight];
  root.hidden = hidden;
  const unshown = wide === 0 && (root.parentElement?.offsetWidth ?? 0) > 0;
  // before the first layout, everything measures zero
  element.size =
    wide > 0 || unshown ? { wide, high } : { wide: text.length * LETTER_PX + FRAME_PX, high: HIGH_PX };
  return element.size;
}

/** Shows the line from a label to its point, or none. */
function drawLeader(element: LabelElement, leader: Line | null): void {
  let leads = '';
  if (leader !== null) {
    const [from, to] = leader;
    const [dx, dy] = [to.x - from.x, to.y - from.y];
    const turn = Math.atan2(dy, dx).toFixed(3);
    leads = `translate(${from.x}px, ${from.y}px) rotate(${turn}rad) scaleX(${Math.round(Math.hypot(dx, dy))})`;
  }
  if (element.leads === leads) return;
  element.leads = leads;
  element.leader.hidden = leader === null;
  element.leader.style.transform = leads;
}
