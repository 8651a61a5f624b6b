import { afterEach, expect, test, vi } from 'vitest';
import { readStored, writeStored } from '../../src/browser/storage.ts';

afterEach(() => vi.unstubAllGlobals());

test('what was kept is found, until null removes it', () => {
  const kept = new Map<string, string>();
  vi.stubGlobal('localStorage', {
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, text: string) => kept.set(key, text),
    removeItem: (key: string) => kept.delete(key),
  });
  expect(readStored('posecast.a')).toBeNull();
  writeStored('posecast.a', 'x');
  expect(readStored('posecast.a')).toBe('x');
  writeStored('posecast.a', null);
  expect(readStored('posecast.a')).toBeNull();
});

test('a storage that throws holds nothing and hurts nobody', () => {
  const refuse = () => {
    throw new DOMException('denied', 'SecurityError');
  };
  vi.stubGlobal('localStorage', { getItem: refuse, setItem: refuse, removeItem: refuse });
  writeStored('posecast.a', 'x');
  writeStored('posecast.a', null);
  expect(readStored('posecast.a')).toBeNull();
});
