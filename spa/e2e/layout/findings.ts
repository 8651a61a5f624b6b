/** What is wrong with a layout: which of its texts and controls lie over each other, and which are cut. Pure. */

/** A rectangle, CSS px from the viewport's upper left corner. */
export interface Box {
  readonly left: number;
  readonly top: number;
  readonly right: number;
  readonly bottom: number;
}

/** One thing that a page shows. `ground`: an element that paints a background or a border of its own. */
export interface Shown {
  readonly kind: 'text' | 'control' | 'ground';
  /** What a person calls it: its place and its words. */
  readonly name: string;
  /** The first and the last number, in document order, of the elements that it consists of. */
  readonly from: number;
  readonly to: number;
  /** Where it would be if nothing cut it: one box for each line of a text. */
  readonly whole: readonly Box[];
  /** What is left of each of `whole` inside of the elements that hide what sticks out, and of the window. */
  readonly seen: readonly Box[];
  /** Whether it can be scrolled to, or read whole elsewhere: in a title, or by opening what it stands in. */
  readonly reachable: boolean;
  /** Of a control: what a tap on its middle meets instead of it. */
  readonly takenBy?: string;
}

/** Less than this, CSS px, is rounding, or the edge of a letter's box that its ink never reaches. */
const SLACK_PX = 1.5;

/** One line for each pair that lies over each other, each thing that is cut and can't be read whole, and each control that
 *  taps don't reach. */
export function findWrong(shown: readonly Shown[]): string[] {
  const wrong = shown.flatMap((one) => {
    const px = cutBy(one);
    return [
      ...(px > SLACK_PX && !one.reachable ? [`cut: ${one.name}`] : []),
      ...(one.takenBy === undefined ? [] : [`out of reach under ${one.takenBy}: ${one.name}`]),
    ];
  });
  const controls = shown.filter(({ kind }) => kind === 'control');
  // what a control says lies where the control lies
  const apart = shown.filter(
    (one) => one.kind !== 'text' || !controls.some((control) => contains(control, one)),
  );
  for (const [i, one] of apart.entries()) {
    for (const other of apart.slice(i + 1)) {
      if (one.kind === 'ground' && other.kind === 'ground') continue;
      if (contains(one, other) || contains(other, one)) continue;
      if (overlap(one, other)) wrong.push(`over each other: ${[one.name, other.name].sort().join(' and ')}`);
    }
  }
  return [...new Set(wrong)];
}

/** By how much the most cut line of it is, CSS px. */
function cutBy({ kind, whole, seen }: Shown): number {
  if (kind === 'ground') return 0;
  const lost = whole.map((box, i) => {
    const left = seen[i] ?? box;
    return Math.max(width(box) - Math.max(0, width(left)), height(box) - Math.max(0, height(left)));
  });
  return Math.max(0, ...lost);
}

function contains(outer: Shown, inner: Shown): boolean {
  return outer.from <= inner.from && inner.to <= outer.to;
}

function overlap(one: Shown, other: Shown): boolean {
  return one.seen.some((a) =>
    other.seen.some(
      (b) =>
        Math.min(a.right, b.right) - Math.max(a.left, b.left) > SLACK_PX &&
        Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > SLACK_PX,
    ),
  );
}

function width({ left, right }: Box): number {
  return right - left;
}

function height({ top, bottom }: Box): number {
  return bottom - top;
}
