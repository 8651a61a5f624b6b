import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { onAccountToken, setAccountToken, setLinkToken, tokenFor } from '../../src/relay/token.ts';
import { takeToken } from '../../src/relay/visitor.ts';
import { Session } from '../../src/stream/session.ts';

const TOKEN = 'L1.hubo.1900000000.abcdefgh.signature';
const STATE = 'http://relay/api/v1/robots/hubo/live';

let shown: string[] = [];
let kept = new Map<string, string>();

function openAt(hash: string): void {
  vi.stubGlobal('window', { location: { hash } });
  takeToken();
}

beforeEach(() => {
  shown = [];
  kept = new Map();
  setLinkToken('');
  vi.stubGlobal('history', {
    state: null,
    replaceState: (_s: unknown, _t: string, url: string) => shown.push(url),
  });
  vi.stubGlobal('sessionStorage', {
    getItem: (name: string) => kept.get(name) ?? null,
    setItem: (name: string, value: string) => kept.set(name, value),
  });
});

afterEach(() => vi.unstubAllGlobals());

it('takes the token out of the address and gives it to that robot alone', () => {
  openAt(`#/r/hubo?t=${TOKEN}`);
  expect(shown).toEqual(['#/r/hubo']);
  expect(tokenFor(STATE)).toBe(TOKEN);
  expect(tokenFor('http://relay/api/v1/robots/hubo2/live')).toBeUndefined();
  expect(tokenFor('http://relay/api/v1/robots')).toBeUndefined();
});

it('remembers it in this tab, and leaves other addresses as they are', () => {
  openAt(`#/r/hubo?t=${TOKEN}`);
  setLinkToken('');
  openAt('#/r/hubo');
  expect(shown).toEqual(['#/r/hubo']);
  expect(tokenFor(STATE)).toBe(TOKEN);
});

it('takes nonsense for no token', () => {
  openAt(`#/r/hubo?t=${TOKEN}`);
  shown = [];
  openAt('#/r/hubo?t=hello');
  expect(shown).toEqual([]);
  expect(tokenFor(STATE)).toBe(TOKEN);
});

it('takes a moment for no token', () => {
  openAt(`#/r/hubo?t=${TOKEN}`);
  shown = [];
  openAt('#/r/hubo?t=2026-11-22T14:02:07.250Z&joint=RKN');
  expect(shown).toEqual([]);
  expect(tokenFor(STATE)).toBe(TOKEN);
});

it('holds it also where nothing can be kept', () => {
  vi.stubGlobal('sessionStorage', undefined);
  openAt(`#/r/hubo?t=${TOKEN}`);
  expect(tokenFor(STATE)).toBe(TOKEN);
  openAt('#/r/g1');
  expect(tokenFor(STATE)).toBeUndefined();
});

it('is the first message of every connection, and never in its address', () => {
  const session = new Session('ws://relay/live', 30, true, () => 0.5, TOKEN);
  for (const nowMs of [0, 100_000]) {
    const [connect] = (nowMs === 0 ? session.start(nowMs) : session.wake(nowMs)).filter(
      (a) => a.do === 'connect',
    );
    expect(connect).toEqual({ do: 'connect', by: 'websocket', url: 'ws://relay/live?hz=30&auth=1' });
    const sent = session.opened(nowMs).flatMap((a) => (a.do === 'send' ? [JSON.parse(a.text)] : []));
    expect(sent[0]).toEqual({ type: 'auth', token: TOKEN });
    session.text(nowMs, '{"type":"status"}'); // it works, so the next request uses the same way
  }
});

it('without one nothing changes', () => {
  const session = new Session('ws://relay/live', 30, true, () => 0.5);
  expect(session.start(0).at(-1)).toEqual({ do: 'connect', by: 'websocket', url: 'ws://relay/live?hz=30' });
  expect(session.opened(0).some((a) => a.do === 'send')).toBe(false);
});

it('stands before the token of an account, which is for all of this relay and for nobody else', () => {
  const heard: (string | undefined)[] = [];
  const leave = onAccountToken(() => heard.push(tokenFor('http://relay/api/v1/robots')));
  openAt(`#/r/hubo?t=${TOKEN}`);
  setAccountToken('account.one');
  setAccountToken('account.one');
  setAccountToken('account.two');
  expect(tokenFor(STATE)).toBe(TOKEN);
  expect(tokenFor('http://relay/api/v1/robots/g1/live')).toBe('account.two');
  expect(tokenFor('https://lab.firebaseio.com/posecast/g1.json')).toBeUndefined();
  expect(tokenFor('http://relay/api/v1/robotsx')).toBeUndefined();
  setAccountToken('');
  expect(heard).toEqual(['account.one', 'account.two', undefined]);
  expect(tokenFor('http://relay/api/v1/robots/g1/live')).toBeUndefined();
  leave();
  setAccountToken('account.three');
  expect(heard.length).toBe(3);
  setAccountToken('');
});

it('is prolonged by a newer one on the same connection; another or none takes another connection', () => {
  const session = new Session('ws://relay/live', 30, true, () => 0.5, 'one');
  session.start(0);
  session.opened(0);
  expect(session.renew(10, 'two')).toEqual([{ do: 'send', text: '{"type":"auth","token":"two"}' }]);
  const urls = (actions: readonly { do: string }[]) =>
    actions.flatMap((action) => ('url' in action ? [action.url] : [action.do]));
  expect(urls(session.renew(20, undefined))).toEqual(['drop', 'post', 'ws://relay/live?hz=30']);
  session.opened(30);
  expect(session.renew(40, undefined)).toEqual([]);
  expect(urls(session.renew(50, 'three'))).toEqual(['drop', 'post', 'ws://relay/live?hz=30&auth=1']);
  session.opened(60);
  session.closed(70, 4401, 'expired');
  expect(session.phase).toBe('ended');
  expect(urls(session.renew(80, 'four')), 'also after the end').toContain('ws://relay/live?hz=30&auth=1');
});
