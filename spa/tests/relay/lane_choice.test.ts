import { afterEach, beforeEach, expect, it, vi } from 'vitest';

const HOME = 'https://page.example/';
const ROBOT = 'robots/demo';

/** The modules as in a page opened at this address beside this `config.json`. */
async function opened(search: string, config: object) {
  vi.resetModules();
  vi.stubGlobal('window', {
    location: { href: `${HOME}${search}#/r/demo`, search, hash: '#/r/demo' },
    localStorage: { getItem: () => null },
  });
  vi.stubGlobal('location', { search });
  vi.stubGlobal('fetch', async () => ({ ok: true, json: async () => config }));
  const [token, addresses] = await Promise.all([
    import('../../src/relay/token.ts'),
    import('../../src/relay/addresses.ts'),
  ]);
  await addresses.accessSettled();
  return { ...token, ...addresses };
}

beforeEach(() => {
  vi.stubGlobal('document', { documentElement: { dataset: {} }, querySelector: () => null });
});
afterEach(() => vi.unstubAllGlobals());

it('takes a socket, and all from the relay, unless something says otherwise', async () => {
  const page = await opened('', { relay: 'https://relay.example' });
  expect(page.laneUrl('demo')).toBeNull();
  expect(page.pastUrl('demo')).toBe(`https://relay.example/api/v1/${ROBOT}/past`);
  expect(page.manifestUrl('demo', 'abc')).toBe(
    `https://relay.example/api/v1/${ROBOT}/model/abc/manifest.json`,
  );
});

it('reads past and model where the config has its lane, and lists robots at the relay', async () => {
  const page = await opened('', { relay: 'https://relay.example', lane: 'https://cdn.example' });
  expect(page.laneUrl('demo')).toBe(`https://cdn.example/api/v1/${ROBOT}/past`);
  expect(page.pastUrl('demo')).toBe(page.laneUrl('demo'));
  expect(page.manifestUrl('demo', 'abc')).toBe(`https://cdn.example/api/v1/${ROBOT}/model/abc/manifest.json`);
  expect(page.apiUrl('robots')).toBe('https://relay.example/api/v1/robots');
  expect(page.streamUrl('demo')).toBe(`wss://relay.example/api/v1/${ROBOT}/live`);
});

it('reads past and model at the relay once a stream had to leave the lane', async () => {
  const page = await opened('', { relay: 'https://relay.example', lane: 'https://cdn.example' });
  page.setAccountToken('T');
  page.leaveLane('demo'); // a socket, only because somebody has signed in
  page.setAccountToken('');
  expect(page.pastUrl('demo')).toContain('https://cdn.example/');
  page.leaveLane('demo');
  expect(page.pastUrl('demo')).toBe(`https://relay.example/api/v1/${ROBOT}/past`);
  expect(page.manifestUrl('demo', 'abc')).toBe(
    `https://relay.example/api/v1/${ROBOT}/model/abc/manifest.json`,
  );
  expect(page.laneUrl('other')).toBeNull();
});

it('takes a socket with a token, and sends that to the relay alone', async () => {
  const page = await opened('', { relay: 'https://relay.example', lane: 'https://cdn.example' });
  const inLane = page.pastUrl('demo');
  page.setAccountToken('T');
  expect(page.laneUrl('demo')).toBeNull();
  expect(page.tokenFor(page.pastUrl('demo'))).toBe('T');
  expect(page.manifestUrl('demo', 'abc')).toContain('https://relay.example/');
  expect(page.tokenFor(inLane), 'asked for before somebody signed in').toBeUndefined();

  page.setAccountToken('');
  page.setLinkToken('L1.demo.1900000000.abcdefgh.signature');
  expect(page.laneUrl('demo')).toBeNull();
  expect(page.laneUrl('other'), 'which the link is not for').not.toBeNull();
  expect(page.tokenFor(inLane)).toBeUndefined();
});

it('keeps tokens for a relay whose lane lies above it on the same host', async () => {
  const page = await opened('', { relay: 'https://host.example/relay', lane: 'https://host.example' });
  page.setAccountToken('T');
  expect(page.tokenFor(page.pastUrl('demo'))).toBe('T');
  expect(page.tokenFor(`https://host.example/api/v1/${ROBOT}/past`)).toBeUndefined();
});

it('reads in segments at the relay itself where the address says so', async () => {
  const page = await opened('?lane=segments', {});
  expect(page.laneUrl('demo')).toBe(`${HOME}api/v1/${ROBOT}/past`);
  page.setAccountToken('T');
  expect(page.laneUrl('demo')).toBeNull();
  expect(page.tokenFor(page.pastUrl('demo'))).toBe('T');
});
