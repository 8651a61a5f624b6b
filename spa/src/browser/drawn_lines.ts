/** A point of the picture, CSS px. */
export interface Spot {
  readonly x: number;
  readonly y: number;
}

/** A line in the picture, CSS px. */
export type Line = readonly [from: Spot, to: Spot];

/** A line still counts for this long after it has moved: people aim at what they saw. */
const RECENT_MS = 150;
/** Lines that change sooner than this are not kept, so that a label has a dozen of them at most. */
const KEPT_MS = 15;

interface Drawn {
  readonly lines: readonly Line[];
  readonly sinceMs: number;
}

/** Label on a body → the lines drawn for it, oldest first, even if the label itself finds no room. */
const DRAWN = new WeakMap<HTMLElement, Drawn[]>();

/** Records the lines drawn for a label; they decide what a tap hits. `nowMs`: from `performance.now()`. */
export function noteLines(label: HTMLElement, lines: readonly Line[], nowMs: number): void {
  const drawn = DRAWN.get(label) ?? [];
  DRAWN.set(label, drawn);
  const newest = drawn.at(-1);
  if (newest !== undefined && alike(newest.lines, lines)) return;
  const before = drawn.at(-2);
  if (before !== undefined && nowMs - before.sinceMs < KEPT_MS) drawn.pop();
  drawn.push({ lines, sinceMs: nowMs });
  while (drawn.length > 1 && drawn[1]!.sinceMs < nowMs - RECENT_MS) drawn.shift();
}

/** A label's current lines, and its lines shortly before. */
export function recentLines(label: HTMLElement, nowMs: number): readonly Line[] {
  const drawn = DRAWN.get(label) ?? [];
  return drawn
    .filter((_, i) => i === drawn.length - 1 || drawn[i + 1]!.sinceMs >= nowMs - RECENT_MS)
    .flatMap(({ lines }) => lines);
}

function alike(a: readonly Line[], b: readonly Line[]): boolean {
  const same = (p: Spot, q: Spot) => p.x === q.x && p.y === q.y;
  return a.length === b.length && a.every(([from, to], i) => same(from, b[i]![0]) && same(to, b[i]![1]));
}
