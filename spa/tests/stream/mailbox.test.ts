import { expect, it } from 'vitest';
import { Mailbox } from '../../src/stream/mailbox.ts';

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
