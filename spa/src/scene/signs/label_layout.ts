import type { Line, Spot } from '../../browser/drawn_lines.ts';

/** Distances of a label from its anchor, and vertical steps beside it, CSS px. */
const GAPS = [10, 34, 70, 120, 190];
const STEP = 12;
const MOST_STEPS = 9;
/** Costs of a place, in px of distance: for every vertical step, and for being on the inner side, which hardly matters for an
 *  anchor near the middle. */
const STEP_COST = 8;
const INNER_COST = 40;
const INNER_COST_NEAR_MIDDLE = 6;
/** Clearance required around a new place. A label that already has its place keeps it with less. CSS px. */
const AIR = 5;
/** A label moves to a better place only if it is better by this much; and to the other side only if its anchor is this far beyond
 *  the middle. CSS px. */
const BETTER = 20;
const BEYOND = 24;
/** From this distance on, a line connects the label to its anchor. CSS px. */
const LEADER = 16;
/** Cell size of the box lookup, and the size of the boxes that a line is made of; CSS px. */
const CELL = 48;
const DOT = 8;
const MOST_DOTS = 96;

/** A label to be placed; CSS px. */
export interface LabelBox {
  /** Identifies the same label in consecutive pictures. */
  readonly key: string;
  readonly wide: number;
  readonly high: number;
  /** The anchor: the point that it names. */
  readonly point: Spot;
  /** The x of the middle of the anchor's robot or group; the label prefers the outer side. */
  readonly middle: number;
}

/** A picture, and the vertical part that notes and buttons leave free for labels; CSS px. */
export interface LabelRoom {
  readonly width: number;
  readonly height: number;
  /** The top of the free part, and its height. */
  readonly top: number;
  readonly free: number;
}

export interface PlacedLabel {
  /** The upper left corner. */
  readonly x: number;
  readonly y: number;
  /** From the label's edge to its anchor; null if it is beside it. */
  readonly leader: Line | null;
}

/** A part of the picture, CSS px. */
export interface Box {
  readonly left: number;
  readonly top: number;
  readonly right: number;
  readonly bottom: number;
}

/** A place of a label relative to its anchor: outer or inner side, distance, vertical steps. */
interface Slot {
  readonly inner: boolean;
  readonly gap: number;
  readonly steps: number;
  readonly cost: number;
}

/** All places, best first. */
function slotsFor(innerCost: number): readonly Slot[] {
  return GAPS.flatMap((gap) =>
    [false, true].flatMap((inner) =>
      Array.from({ length: 2 * MOST_STEPS + 1 }, (_, i): Slot => {
        const steps = i - MOST_STEPS;
        return { inner, gap, steps, cost: gap + Math.abs(steps) * STEP_COST + (inner ? innerCost : 0) };
      }),
    ),
  ).sort((a, b) => a.cost - b.cost || a.steps - b.steps);
}

const SLOTS = slotsFor(INNER_COST);
const SLOTS_NEAR_MIDDLE = slotsFor(INNER_COST_NEAR_MIDDLE);

/**
 * Places labels beside their anchors, so that they cover no drawn line, no other label and no text. They stay in the picture's
 * free part, each on its outer side if there is room. A label keeps its place beside its anchor until something moves into it, so
 * that labels don't flicker. The first label chooses first. The cost grows linearly with the number of labels; each tries at most
 * 190 places.
 */
export class LabelLayout {
  readonly #kept = new Map<string, { slot: Slot; outer: 1 | -1 }>();

  /** `lines`: drawn lines that must stay visible; `words`: text already over the picture. Labels that fit nowhere are placed
   *  where they cover least. */
  place(
    labels: readonly LabelBox[],
    lines: readonly Line[],
    room: LabelRoom,
    words: readonly Box[] = [],
  ): Map<string, PlacedLabel> {
    const taken = new CoveredCells();
    for (const box of words) taken.add(box);
    for (const line of lines) taken.addLine(line);
    const placed = new Map<string, PlacedLabel>();
    for (const label of labels) {
      const outer = this.#outerOf(label);
      const slot = this.#choose(label, outer, taken, room);
      this.#kept.set(label.key, { slot, outer });
      const box = boxAt(label, slot, outer, room);
      taken.add(box);
      const leader = leaderOf(box, label.point);
      if (leader !== null) taken.addLine(leader);
      placed.set(label.key, { x: box.left, y: box.top, leader });
    }
    for (const key of this.#kept.keys()) if (!placed.has(key)) this.#kept.delete(key);
    return placed;
  }

  #outerOf({ key, point, middle }: LabelBox): 1 | -1 {
    const before = this.#kept.get(key)?.outer;
    const off = point.x - middle;
    if (before !== undefined && before * off > -BEYOND) return before;
    return off < 0 ? -1 : 1;
  }

  #choose(label: LabelBox, outer: 1 | -1, taken: CoveredCells, room: LabelRoom): Slot {
    const kept = this.#kept.get(label.key);
    const same = kept?.outer === outer && taken.coveredBy(boxAt(label, kept.slot, outer, room)) === 0;
    const before = same ? kept.slot : null;
    let least = Infinity;
    const slots = Math.abs(label.point.x - label.middle) < BEYOND ? SLOTS_NEAR_MIDDLE : SLOTS;
    let best = slots[0]!;
    for (const slot of slots) {
      if (before !== null && slot.cost > before.cost - BETTER) return before;
      const covered = taken.coveredBy(boxAt(label, slot, outer, room, AIR));
      if (covered < least) [least, best] = [covered, slot];
      if (covered === 0) break;
    }
    return best;
  }
}

/** Where a label in a slot is, moved into the free part of the picture; `air` larger on all sides. */
function boxAt({ wide, high, point }: LabelBox, slot: Slot, outer: 1 | -1, room: LabelRoom, air = 0): Box {
  const right = (outer === 1) !== slot.inner;
  const x = Math.round(point.x + (right ? slot.gap : -slot.gap - wide));
  const y = Math.round(point.y + slot.steps * STEP - high / 2);
  const left = Math.max(0, Math.min(x, room.width - wide));
  const top = Math.max(room.top, Math.min(y, room.top + room.free - high));
  return { left: left - air, top: top - air, right: left + wide + air, bottom: top + high + air };
}

/** The line from a label's nearest edge to its anchor; null if that is beside it. */
function leaderOf({ left, top, right, bottom }: Box, point: Spot): Line | null {
  const edge = {
    x: Math.max(left, Math.min(point.x, right)),
    y: Math.max(top + 3, Math.min(point.y, bottom - 3)),
  };
  return Math.hypot(edge.x - point.x, edge.y - point.y) < LEADER ? null : [edge, point];
}

/** Boxes in the picture, indexed by the cells that they cover. */
class CoveredCells {
  readonly #cells = new Map<number, Box[]>();

  add(box: Box): void {
    for (const cell of cellsOf(box)) {
      const boxes = this.#cells.get(cell);
      if (boxes === undefined) this.#cells.set(cell, [box]);
      else boxes.push(box);
    }
  }

  /** Adds a line as a row of small boxes. */
  addLine([from, to]: Line): void {
    const long = Math.hypot(to.x - from.x, to.y - from.y);
    const dots = Math.min(MOST_DOTS, Math.ceil(long / DOT));
    for (let i = 0; i <= dots; i += 1) {
      const part = dots === 0 ? 0 : i / dots;
      const [x, y] = [from.x + (to.x - from.x) * part, from.y + (to.y - from.y) * part];
      this.add({ left: x - DOT / 2, top: y - DOT / 2, right: x + DOT / 2, bottom: y + DOT / 2 });
    }
  }

  /** The area of the taken boxes that this box covers, px². */
  coveredBy(box: Box): number {
    let sum = 0;
    for (const cell of cellsOf(box)) {
      for (const other of this.#cells.get(cell) ?? []) {
        const wide = Math.min(box.right, other.right) - Math.max(box.left, other.left);
        const high = Math.min(box.bottom, other.bottom) - Math.max(box.top, other.top);
        if (wide > 0 && high > 0) sum += wide * high;
      }
    }
    return sum;
  }
}

function* cellsOf({ left, top, right, bottom }: Box): Generator<number> {
  for (let x = Math.floor(left / CELL); x <= Math.floor(right / CELL); x += 1) {
    for (let y = Math.floor(top / CELL); y <= Math.floor(bottom / CELL); y += 1) yield x * 1e4 + y;
  }
}
