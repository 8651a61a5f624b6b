import { afterEach, expect, it, vi } from 'vitest';
import { seenByAnyone } from '../../src/app/share/ShareSheet.tsx';
import { tokenFor } from '../../src/relay/token.ts';
import { takeToken } from '../../src/relay/visitor.ts';

const TOKEN = 'L1.hubo.1900000000.abcdefgh.signature';
const STATE = 'http://relay/api/v1/robots/hubo/live';

function openAt(hash: string, search: string): void {
  vi.stubGlobal('location', { search });
  vi.stubGlobal('window', { location: { hash, search } });
  vi.stubGlobal('history', { state: null, replaceState: () => {} });
  takeToken();
}

afterEach(() => vi.unstubAllGlobals());

it('no token is shown where the page is to show what anyone sees, and it is there again afterwards', () => {
  const kept = new Map<string, string>();
  vi.stubGlobal('sessionStorage', {
    getItem: (name: string) => kept.get(name) ?? null,
    setItem: (name: string, value: string) => kept.set(name, value),
  });
  openAt(`#/r/hubo?t=${TOKEN}`, '?relay=https://relay.example&as=anyone');
  expect(tokenFor(STATE)).toBeUndefined();
  openAt('#/r/hubo', '?as=anyoneelse');
  expect(tokenFor(STATE)).toBe(TOKEN);
});

it('nor where nothing can be kept', () => {
  vi.stubGlobal('sessionStorage', undefined);
  openAt(`#/r/hubo?t=${TOKEN}`, '?as=anyone');
  expect(tokenFor(STATE)).toBeUndefined();
});

it('the address of what anyone sees keeps all else', () => {
  const link = 'https://robots.example/lab/?relay=https%3A%2F%2Frelay.example%2F#/r/hubo?shown=both';
  expect(seenByAnyone(link)).toBe(link.replace('#', '&as=anyone#'));
});
