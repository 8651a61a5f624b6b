import { expect, test } from 'vitest';
import { Acknowledgements } from '../../src/stream/pacing.ts';

test('the first message is acknowledged at once, the next ones once a second together', () => {
  const acks = new Acknowledgements();
  expect(acks.takeDue(0, null)).toBeNull();
  acks.countMessage();
  expect(acks.takeDue(0, null)).toBe(1);
  acks.countMessage();
  acks.countMessage();
  expect(acks.takeDue(999, 20)).toBeNull();
  expect(acks.takeDue(1000, 20)).toBe(3);
  expect(acks.takeDue(5000, 20)).toBeNull();
});

test('from afar twice a second', () => {
  const acks = new Acknowledgements();
  acks.countMessage();
  expect(acks.takeDue(0, 501)).toBe(1);
  acks.countMessage();
  expect(acks.takeDue(499, 501)).toBeNull();
  expect(acks.takeDue(500, 500)).toBeNull();
  expect(acks.takeDue(500, 501)).toBe(2);
});
