/** Problems in a layout: texts and controls that overlap or are cut off. Pure. */

/** A rectangle, CSS px from the viewport's upper left corner. */
export interface Box {
  readonly left: number;
  readonly top: number;
  readonly right: number;
  readonly bottom: number;
}

/** An item shown on a page. `ground`: an element that paints its own background or border. */
export interface Shown {
  readonly kind: 'text' | 'control' | 'ground';
  /** Its name for people: its place and its text. */
  readonly name: string;
  /** The range of its elements, as numbers in document order. */
  readonly from: number;
  readonly to: number;
  /** Its boxes if nothing cut it: one for each line of a text. */
  readonly whole: readonly Box[];
  /** The visible part of each of `whole`, inside the elements that clip it and the window. */
  readonly seen: readonly Box[];
  /** Whether it can be scrolled to, or read in full elsewhere: in a title, or by opening its container. */
  readonly reachable: boolean;
  /** For a control: what a tap on its middle hits instead. */
  readonly takenBy?: string;
}

/** Anything below this, CSS px, is rounding, or the edge of a letter's box that its ink never reaches. */
const SLACK_PX = 1.5;

/** One line for each overlapping pair, each cut-off item that can't be read in full, and each control that taps can't reach. */
export function findWrong(shown: readonly Shown[]): string[] {
  const wrong = shown.flatMap((one) => {
    const px = cutBy(one);
    return [
      ...(px > SLACK_PX && !one.reachable ? [`cut: ${one.name}`] : []),
      ...(one.takenBy === undefined ? [] : [`out of reach under ${one.takenBy}: ${one.name}`]),
    ];
  });
  const controls = shown.filter(({ kind }) => kind === 'control');
  // a control's text overlaps the control itself
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

/** The amount by which its most clipped line is cut, CSS px. */
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
