import { describe, expect, it } from 'vitest';
import type { Line, Spot } from '../../../src/browser/drawn_lines.ts';
import { type LabelBox, LabelLayout, type PlacedLabel } from '../../../src/scene/signs/label_layout.ts';

const ROOM = { width: 800, height: 600, top: 40, free: 500 };
const [WIDE, HIGH] = [90, 19];

const label = (key: string, x: number, y: number, middle = 400): LabelBox => ({
  ...{ key, wide: WIDE, high: HIGH, point: { x, y }, middle },
});

function overlap(a: PlacedLabel, b: PlacedLabel): boolean {
  return Math.abs(a.x - b.x) < WIDE && Math.abs(a.y - b.y) < HIGH;
}

/** Whether a line passes through a label, sampled in steps of a pixel. */
function crosses({ x, y }: PlacedLabel, [from, to]: Line): boolean {
  const steps = Math.ceil(Math.hypot(to.x - from.x, to.y - from.y)) + 1;
  return Array.from({ length: steps + 1 }, (_, i) => i / steps).some((part) => {
    const [px, py] = [from.x + (to.x - from.x) * part, from.y + (to.y - from.y) * part];
    return px > x && px < x + WIDE && py > y && py < y + HIGH;
  });
}

/** Reproducible numbers from 0 to 1. */
function* dice(): Generator<number, never> {
  for (let seed = 7; ; ) {
    seed = (seed * 48271) % 2147483647;
    yield seed / 2147483647;
  }
}

describe('the layout of labels', () => {
  it('puts the forces of two feet on their outer sides, beside their points', () => {
    const placed = new LabelLayout().place([label('l', 430, 400), label('r', 370, 400)], [], ROOM);
    expect(placed.get('l')).toEqual({ x: 440, y: 391, leader: null });
    expect(placed.get('r')).toEqual({ x: 370 - 10 - WIDE, y: 391, leader: null });
  });

  it('of two feet behind each other are both readable, whichever is nearer the middle', () => {
    for (const x of [300, 399, 400, 401, 500]) {
      const placed = [
        ...new LabelLayout().place([label('l', x, 400), label('r', x, 404)], [], ROOM).values(),
      ];
      expect(overlap(placed[0]!, placed[1]!)).toBe(false);
    }
  });

  it('covers no words that stand over the picture, also where it stood before they came', () => {
    const words = { left: 440, top: 380, right: 560, bottom: 420 };
    const layout = new LabelLayout();
    expect(layout.place([label('l', 430, 400)], [], ROOM).get('l')).toMatchObject({ x: 440, y: 391 });
    const { x, y } = layout.place([label('l', 430, 400)], [], ROOM, [words]).get('l')!;
    expect(x + WIDE <= words.left || x >= words.right || y + HIGH <= words.top || y >= words.bottom).toBe(
      true,
    );
  });

  it('covers no arrow, its own or another’s, with a line to its point where it had to go farther away', () => {
    const point: Spot = { x: 420, y: 300 };
    const lines: Line[] = [
      [{ x: 420, y: 420 }, point],
      [
        { x: 380, y: 296 },
        { x: 520, y: 300 },
      ],
      [
        { x: 450, y: 200 },
        { x: 450, y: 420 },
      ],
    ];
    const placed = new LabelLayout().place([label('f', point.x, point.y)], lines, ROOM).get('f')!;
    for (const line of lines) expect(crosses(placed, line)).toBe(false);
    expect(placed.leader?.[1]).toEqual(point);
  });

  it('stays in the free part of the picture: under no note, over no button, not cut off at a side', () => {
    const labels = [label('a', 2, 5), label('b', 798, 45), label('c', 797, 598), label('d', 400, 545)];
    const placed = [...new LabelLayout().place(labels, [], ROOM).values()];
    for (const { x, y } of placed) {
      expect(x >= 0 && x + WIDE <= ROOM.width).toBe(true);
      expect(y >= ROOM.top && y + HIGH <= ROOM.top + ROOM.free).toBe(true);
    }
  });

  it('has room for 32 labels of points thrown anywhere, none over another or over an arrow', () => {
    const next = dice();
    for (let round = 0; round < 20; round += 1) {
      const points = Array.from({ length: 32 }, () => ({
        x: 100 + 600 * next.next().value,
        y: 80 + 400 * next.next().value,
      }));
      const lines = points.slice(0, 6).map(
        ({ x, y }): Line => [
          { x, y: y + 60 },
          { x, y },
        ],
      );
      const layout = new LabelLayout();
      const labels = points.map(({ x, y }, i) => label(`${i}`, x, y));
      const placed = [...layout.place(labels, lines, ROOM).values()];
      expect(placed.length).toBe(32);
      for (const [i, a] of placed.entries()) {
        for (const b of placed.slice(0, i)) expect(overlap(a, b)).toBe(false);
        for (const line of lines) expect(crosses(a, line)).toBe(false);
      }
      const again = [...layout.place(labels, lines, ROOM).values()];
      expect(again, 'the same picture again').toEqual(placed);
      expect([...new LabelLayout().place(labels, lines, ROOM).values()], 'and by another').toEqual(placed);
    }
  });

  it('does not flicker: points that tremble move their labels no more than they move', () => {
    const layout = new LabelLayout();
    const next = dice();
    const shake = () => 3 * next.next().value - 1.5;
    const at: readonly (readonly [number, number])[] = [
      [399, 300],
      [401, 303],
      [410, 318],
      [390, 330],
    ];
    // just beyond the clearance that a new place requires
    const wall: Line = [
      { x: 139, y: 100 },
      { x: 139, y: 500 },
    ];
    let before: PlacedLabel[] | null = null;
    let jumps = 0;
    for (let frame = 0; frame < 100; frame += 1) {
      const labels = at.map(([x, y], i) => label(`${i}`, x + shake(), y + shake()));
      labels.push(label('beside a wall', 30 + shake(), 300 + shake(), 0));
      const placed = [...layout.place(labels, [wall], ROOM).values()];
      for (const [i, { x, y }] of (before ?? placed).entries()) {
        if (Math.hypot(placed[i]!.x - x, placed[i]!.y - y) > 8) jumps += 1;
      }
      before = placed;
    }
    expect(jumps, 'at most once, to a better place that has become free').toBeLessThanOrEqual(1);
  });

  it('goes back to the better place when that is free again, and to the other side when its point is', () => {
    const layout = new LabelLayout();
    const [own, wall] = [
      label('f', 430, 300),
      [
        { x: 465, y: 100 },
        { x: 465, y: 500 },
      ] as const,
    ];
    const free = layout.place([own], [], ROOM).get('f');
    expect(layout.place([own], [wall], ROOM).get('f')).not.toEqual(free);
    expect(layout.place([own], [], ROOM).get('f')).toEqual(free);
    expect(layout.place([label('f', 390, 300)], [], ROOM).get('f')!.x).toBe(400);
    expect(layout.place([label('f', 370, 300)], [], ROOM).get('f')!.x).toBe(370 - 10 - WIDE);
  });

  it('with no room at all still places every label inside the picture', () => {
    const tiny = { width: 100, height: 30, top: 5, free: 20 };
    const labels = Array.from({ length: 8 }, (_, i) => label(`${i}`, 50, 15));
    for (const { x, y } of new LabelLayout().place(labels, [], tiny).values()) {
      expect([x >= 0, x + WIDE <= 100, y >= 5, y + HIGH <= 25]).toEqual([true, true, true, true]);
    }
  });
});
