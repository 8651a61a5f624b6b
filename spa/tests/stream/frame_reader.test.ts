import { expect, it } from 'vitest';
import { Mailbox, Overlap } from '../../src/stream/frame_reader.ts';

it('passes over what was shown before, until something else comes', () => {
  const overlap = new Overlap();
  expect(overlap.isShown({ seq: 7, tS: 0.5 })).toBe(false);
  overlap.begin({ seq: 7, tS: 0.5 });
  expect(overlap.isShown({ seq: 7, tS: 0.5 })).toBe(true);
  expect(overlap.isShown({ seq: 7, tS: 0.5 })).toBe(true);
  expect(overlap.isShown({ seq: 8, tS: 0.6 })).toBe(false);
  expect(overlap.isShown({ seq: 7, tS: 0.5 }), 'of a robot that was started anew').toBe(false);
});

it('lets a frame of the same number and another time through, and all where nothing was shown', () => {
  const overlap = new Overlap();
  overlap.begin({ seq: 7, tS: 0.5 });
  expect(overlap.isShown({ seq: 7, tS: 0.25 })).toBe(false);
  overlap.begin(null);
  expect(overlap.isShown({ seq: 7, tS: 0.5 })).toBe(false);
});

it('passes over what another relay tells late, but not another run of the robot', () => {
  const overlap = new Overlap();
  overlap.begin({ seq: 70, tS: 5 });
  expect(overlap.isShown({ seq: 69, tS: 4.96 })).toBe(true);
  expect(overlap.isShown({ seq: 70, tS: 5 })).toBe(true);
  expect(overlap.isShown({ seq: 71, tS: 5.03 })).toBe(false);
  expect(overlap.isShown({ seq: 69, tS: 4.96 })).toBe(false);
  overlap.begin({ seq: 70, tS: 5 });
  expect(overlap.isShown({ seq: 1, tS: 0.03 })).toBe(false);
});

it('hands over one at a time, and of what comes meanwhile only the newest', () => {
  const box = new Mailbox<number>();
  expect(box.put(1)).toBe(1);
  expect(box.put(2)).toBeNull();
  expect(box.put(3)).toBeNull();
  expect(box.taken()).toBe(3);
  expect(box.replaced).toBe(1);
  expect(box.taken()).toBeNull();
  expect(box.put(4)).toBe(4);
});

it('forgets what has lost its meaning', () => {
  const box = new Mailbox<number>();
  box.put(1);
  box.put(2);
  box.clear();
  expect(box.taken()).toBeNull();
  expect(box.put(3)).toBe(3);
});
