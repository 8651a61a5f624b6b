import { beforeEach, describe, expect, it } from 'vitest';
import { Scrubber } from '../../src/app/past/time_line/scrubber.ts';
import type { Span } from '../../src/past/past_types.ts';
import { FakePast, timelineOf } from '../rigs/past_fake.ts';

const T = Date.UTC(2026, 10, 22, 14, 30);
/** A pixel is a second. */
const VIEW = { fromMs: T - 600_000, toMs: T, widthPx: 614 };
/** The place of so many seconds ago. */
const ago = (s: number) => 607 - s;

let past: FakePast;
let frames: (() => void)[];
let drafts: (Span | null)[];
let scrubber: Scrubber;

beforeEach(() => {
  past = new FakePast(T, timelineOf(T, 10, [{ atMs: T - 300_000 }]));
  frames = [];
  drafts = [];
  scrubber = new Scrubber(
    past,
    (run) => {
      frames.push(run);
      return () => frames.splice(frames.indexOf(run), 1);
    },
    (draft) => drafts.push(draft),
  );
});

const press = (xPx: number, how: { shift?: boolean; touch?: boolean } = {}) =>
  scrubber.down(VIEW, T, { xPx, shift: false, touch: false, ...how });
const draw = () => {
  for (const frame of frames.splice(0)) frame();
};

describe('a tap on the track', () => {
  it('goes to its moment, and settles there', () => {
    press(ago(100));
    scrubber.up(ago(101));
    expect(past.told).toEqual(['attend', 'scrub 100', 'settle']);
  });

  it('near a fault goes to two seconds before it', () => {
    press(ago(292));
    scrubber.up(ago(292));
    expect(past.told).toEqual(['attend', 'scrub 302', 'settle']);
  });

  it('at the right end goes back to live', () => {
    press(ago(1));
    scrubber.up(ago(1));
    expect(past.told.at(-1)).toBe('live');
    expect(past.told).not.toContain('settle');
  });
});

describe('a drag', () => {
  it('seeks once a frame, and last where it ends', () => {
    press(ago(100));
    for (const s of [110, 120, 130]) scrubber.move(ago(s));
    expect(past.told).toEqual(['attend', 'scrub 100']);
    draw();
    scrubber.move(ago(140));
    scrubber.up(ago(150));
    expect(past.told).toEqual(['attend', 'scrub 100', 'scrub 130', 'scrub 150', 'settle']);
    draw();
    scrubber.move(ago(10));
    expect(past.told.at(-1)).toBe('settle');
  });

  it('settles if the system takes it away, and only once', () => {
    press(ago(100));
    scrubber.move(ago(200));
    scrubber.cancel();
    scrubber.cancel();
    expect(past.told).toEqual(['attend', 'scrub 100', 'scrub 200', 'settle']);
    expect(scrubber.held).toBe(false);
  });

  it('that passes a fault does not snap to it', () => {
    press(ago(100));
    scrubber.move(ago(301));
    scrubber.up(ago(301));
    expect(past.told).toContain('scrub 301');
  });
});

describe('a loop', () => {
  it('is drawn with Shift in either direction, and begins where it was drawn', () => {
    press(ago(100), { shift: true });
    scrubber.move(ago(130));
    expect(drafts.at(-1)).toEqual({ fromMs: T - 130_000, toMs: T - 100_000 });
    expect(past.told).toEqual([]);
    scrubber.up(ago(140));
    expect(past.told).toEqual(['loop 140 to 100', 'seek 140']);
    expect(drafts.at(-1)).toBeNull();
  });

  it('leaves a playhead that is in it where it is', () => {
    past.rest(120);
    press(ago(100), { shift: true });
    scrubber.up(ago(140));
    expect(past.told).toEqual(['loop 140 to 100']);
  });

  it('is not made by a click', () => {
    press(ago(100), { shift: true });
    scrubber.up(ago(100));
    expect(past.told).toEqual([]);
  });

  it('is changed at its ends, which a finger need not hit so well', () => {
    past.rest(120);
    past.set({ loop: { fromMs: T - 140_000, toMs: T - 100_000 } });
    press(ago(150), { touch: true });
    scrubber.up(ago(160));
    expect(past.told).toEqual(['loop 160 to 100']);
    press(ago(91));
    scrubber.up(ago(91));
    expect(past.told.slice(1)).toEqual(['attend', 'scrub 91', 'settle']);
  });
});
