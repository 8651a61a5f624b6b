import { describe, expect, it } from 'vitest';
import { chooseRelay, furtherSources, readConfig } from '../../src/relay/config.ts';

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
    for (const odd of [null, [], 'x', 7, { relay: 7, relays: 'x', lane: 7 }]) {
      expect(readConfig(odd)).toEqual(NOTHING);
    }
  });

  it('is a mirror only where config.json names a database', () => {
    const config = readConfig({ firebase: { databaseURL: 'https://lab-default-rtdb.firebaseio.com' } });
    expect(chooseRelay(HOME, '?source=firebase', config)).toEqual({
      base: HOME,
      mirror: 'https://lab-default-rtdb.firebaseio.com/',
      lane: null,
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
      expect(chooseRelay(HOME, search, of)).toEqual({
        base: null,
        mirror: null,
        lane: null,
        refused: search,
      });
    }
    expect(chooseRelay(HOME, '?source=firebase&relay=https://evil.example', config).base).toBeNull();
  });

  it('is read by way of a cache where config.json names one, or the address asks for it', () => {
    const cached = readConfig({
      relay: 'https://relay.example',
      relays: ['https://other.example'],
      lane: 'https://cdn.example/lab',
      firebase: { databaseURL: 'https://lab.firebaseio.com' },
    });
    const lane = (search: string, config = cached) => chooseRelay(HOME, search, config).lane;
    expect(lane('')).toBe('https://cdn.example/lab/');
    expect(lane('?lane=segments')).toBe('https://cdn.example/lab/');
    expect(lane('?lane=https://evil.example'), 'the address names no cache').toBe('https://cdn.example/lab/');
    expect(lane('?relay=https://other.example'), "the cache is another relay's").toBeNull();
    expect(lane('?relay=https://other.example&lane=segments')).toBe('https://other.example/');
    expect(lane('?source=firebase'), 'a mirror has no segments').toBeNull();
    expect(lane('?lane=segments', NOTHING)).toBe(HOME);
    for (const search of ['', '?lane=', '?lane=1', '?lane=https://evil.example'])
      expect(lane(search, NOTHING), search).toBeNull();
    for (const bad of ['http://cdn.example', 'javascript:alert(1)', 'https://', 7])
      expect(lane('', readConfig({ lane: bad })), String(bad)).toBeNull();
    expect(lane('', readConfig({ lane: '/cached' }))).toBe('https://pages.example/cached/');
  });

  it('and its cache are among those that the browser lets the page talk to', () => {
    const sources = (said: object, search = '') =>
      furtherSources(chooseRelay(HOME, search, readConfig(said)), null).trim();
    expect(sources({ relay: 'https://relay.example' })).toBe('');
    expect(sources({ lane: 'https://cdn.example/lab' })).toBe('https://cdn.example');
    expect(sources({ lane: "https://cdn.example/'self' *; script-src *" })).toBe('https://cdn.example');
    expect(sources({ lane: 'https://cdn.example' }, '?relay=https://evil.example')).toBe('');
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
