import { describe, expect, it } from 'vitest';
import { chooseRelay, readConfig } from '../src/relay/config.ts';

const HOME = 'https://pages.example/robots/';
const NOTHING = readConfig(null);
const base = (search: string, config = NOTHING, home = HOME) => chooseRelay(home, search, config).base;

describe('the relay', () => {
  it('is where the page lies, whatever the path, unless something says otherwise', () => {
    expect(base('')).toBe(HOME);
    expect(base('?relay=')).toBe(HOME);
    expect(base('?lang=ko')).toBe(HOME);
  });

  it('is the one of config.json', () => {
    expect(base('', readConfig({ relay: 'https://relay.example' }))).toBe('https://relay.example/');
    expect(base('', readConfig({ relay: 'wss://relay.example/lab' }))).toBe('https://relay.example/lab/');
    expect(base('', readConfig({ relay: '../' }))).toBe('https://pages.example/');
  });

  it('is the one of the address, where config.json allows it', () => {
    const config = readConfig({ relay: 'https://relay.example', relays: ['https://other.example/x/', 7] });
    expect(base('?relay=https://other.example/x', config)).toBe('https://other.example/x/');
    expect(base('?relay=wss://other.example/x//', config)).toBe('https://other.example/x/');
    expect(base('?relay=https://relay.example', config)).toBe('https://relay.example/');
    expect(base('?relay=./', config), "the page's own").toBe(HOME);
  });

  it('is none that nobody has allowed', () => {
    const config = readConfig({ relays: ['https://other.example/x'] });
    for (const bad of [
      'https://evil.example',
      'https://other.example',
      'https://other.example/x/../',
      'https://other.example.evil/x',
      'https://user@evil.example/x',
      'javascript:alert(1)',
      'http://other.example/x',
      '//evil.example',
      'https://',
    ]) {
      const chosen = chooseRelay(HOME, `?relay=${encodeURIComponent(bad)}`, config);
      expect(chosen.base, bad).toBeNull();
      expect(chosen.refused, bad).not.toBe('');
    }
  });

  it('is read in the clear only on this computer, or where the page itself is', () => {
    expect(base('', readConfig({ relay: 'http://relay.example' }))).toBe(HOME);
    expect(base('', readConfig({ relay: 'http://127.0.0.1:8080' }))).toBe('http://127.0.0.1:8080/');
    expect(base('', readConfig({ relay: '/relay' }), 'http://lab.local/page/')).toBe(
      'http://lab.local/relay/',
    );
  });

  it('has a config that may be anything', () => {
    for (const odd of [null, [], 'x', 7, { relay: 7, relays: 'x' }]) {
      expect(readConfig(odd)).toEqual({ relay: null, relays: [], accounts: null, database: null });
    }
  });

  it('is a mirror only where config.json names a database', () => {
    const config = readConfig({ firebase: { databaseURL: 'https://lab-default-rtdb.firebaseio.com' } });
    expect(chooseRelay(HOME, '?source=firebase', config)).toEqual({
      base: HOME,
      mirror: 'https://lab-default-rtdb.firebaseio.com/',
      refused: null,
    });
    expect(chooseRelay(HOME, '', config).mirror).toBeNull();
    expect(chooseRelay(HOME, '?source=', config).mirror).toBeNull();
    for (const [search, of] of [
      ['?source=firebase', NOTHING],
      ['?source=https://evil.example', config],
      ['?source=firebase', readConfig({ firebase: { databaseURL: 'http://lab.firebaseio.com' } })],
      ['?source=firebase', readConfig({ firebase: 'https://lab.firebaseio.com' })],
    ] as const) {
      expect(chooseRelay(HOME, search, of)).toEqual({ base: null, mirror: null, refused: search });
    }
    expect(chooseRelay(HOME, '?source=firebase&relay=https://evil.example', config).base).toBeNull();
  });

  it('signs people in only where config.json names a project', () => {
    const of = (firebase: unknown) => readConfig({ firebase }).accounts;
    const project = { apiKey: 'k', projectId: 'lab' };
    expect(of({ ...project, authDomain: 'lab.firebaseapp.com', appId: 7 })).toEqual({
      ...project,
      emulator: undefined,
    });
    expect(of({ ...project, emulator: 'http://127.0.0.1:9099' })?.emulator).toBe('http://127.0.0.1:9099');
    for (const evil of ['http://evil.example:9099', 'http://127.0.0.1:9099 https://evil.example', '*', 7]) {
      expect(of({ ...project, emulator: evil })?.emulator).toBeUndefined();
    }
    for (const odd of [null, 7, [], { apiKey: 'k' }, { projectId: 'lab' }, { apiKey: 7, projectId: 'lab' }]) {
      expect(of(odd)).toBeNull();
    }
  });
});
