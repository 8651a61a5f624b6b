import { expect, test } from 'vitest';
import { createStore, Emitter } from '../src/kit.ts';

test('listeners are told of every value until they leave', () => {
  const store = createStore(1);
  const seen: number[] = [];
  const leave = store.subscribe(() => seen.push(store.get()));
  store.set(2);
  store.set(2);
  leave();
  store.set(3);
  expect(seen).toEqual([2, 2]);
  expect(store.get()).toBe(3);
});

test('an emitter calls who listens, once each, until they leave or all are removed', () => {
  const emitter = new Emitter();
  const heard: string[] = [];
  const leave = emitter.on(() => heard.push('first'));
  emitter.on(() => heard.push('second'));
  emitter.emit();
  leave();
  emitter.emit();
  emitter.clear();
  emitter.emit();
  expect(heard).toEqual(['first', 'second', 'second']);
});
