import { writeFileSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { Host } from './host.ts';
import { hasSkin, is } from './robot_page.ts';
import { REPO } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const URDF = path.join(REPO, 'edge-agent/src/posecast_edge/demo_bundle/robot.urdf');
const STANDING = {
  pos: { RKN: 0.9, LKN: 0.9 },
  ref: { RKN: 0.4, LKN: 0.9 },
  wave: { pos: { RSP: [0.2, 0.2] } },
};
const demo = stage.share(async (stack) => {
  const relay = await stack.relay();
  stack.fedEdge(relay, STANDING, { urdf: URDF });
  return relay;
});
/** The middle of a robot is that of its box, which moves a little with its arms. */
const NEAR_M = 0.1;

interface Stand {
  readonly position: readonly number[];
  readonly target: readonly number[];
}

const stand = (page: Page) => page.evaluate<Stand | null>('window.posecast?.scene?.stand ?? null');
const hash = (page: Page) => page.evaluate<string>('location.hash');
const near = (a: Stand | null, b: Stand | null) =>
  a !== null &&
  b !== null &&
  [...a.position, ...a.target].every(
    (metres, i) => Math.abs(metres - [...b.position, ...b.target][i]!) < NEAR_M,
  );

describe('the address', () => {
  it('holds what is looked at, and another page opens the same', async () => {
    const relay = await demo();
    const page = await stage.open(`${relay.url}/#/r/demo`);
    await until('a body', () => hasSkin(page));
    expect(await hash(page), 'nothing to tell yet').toBe('#/r/demo');
    for (const key of ['ArrowLeft', 'ArrowLeft', 'ArrowUp', '+', '+']) await page.press(key);
    for (const [what, last] of [
      ['pos, ref or both', 'input[name=shown]'],
      ['a row', 'tr[data-label="RKN"] button'],
    ] as const) {
      await until(what, () =>
        page.evaluate<boolean>(
          `(([one]) => one !== undefined && (one.click(), true))([...document.querySelectorAll('${last}')].slice(-1))`,
        ),
      );
    }
    await page.evaluate('document.activeElement?.blur()');
    await until('in the address', async () => /shown=both&joint=RKN&eye=/.test(await hash(page)));
    const there = await stand(page);
    const link = (await page.evaluate<string>('location.href')).replace('/#/', '/r/demo#/');

    await page.press('s');
    await until('the sheet', async () => (await page.findByTestId('share').count()) === 1);
    // without #, a chat finds the robot's name and picture there
    await until('the link', async () => (await page.findByTestId('share').text()).includes(link));
    expect(await page.findByTestId('share').text()).toContain('/embed/demo#/r/demo?');
    expect(
      await page.findByTestId('only-here').count(),
      'a link to this computer is of no use elsewhere',
    ).toBe(1);
    await page.screenshot('share-laptop.png');
    await page.viewport({ width: 390, height: 844 });
    await page.screenshot('share-phone.png');

    const other = await stage.open(`${link}&theme=light&angle=deg`);
    await until('the same place', async () => near(await stand(other), there));
    await until('the same joint', async () => (await other.findByTestId('joint-card').count()) === 1);
    const settings = await other.evaluate<Record<string, unknown>>('window.posecast.settings');
    expect(settings).toMatchObject({ shown: 'both', theme: 'light', angle: 'deg' });
    expect(await other.evaluate<string>('document.documentElement.dataset.theme')).toBe('light');
    await until('a body', () => hasSkin(other));
    await until('still the same place', async () => near(await stand(other), there));
    const kept = await other.evaluate<string | null>('localStorage.getItem("posecast.settings")');
    expect(kept ?? '', 'nothing that the link brought is kept').not.toMatch(/shown|theme|angle/);
  });

  it('may name what does not exist: the page opens without it', async () => {
    const relay = await demo();
    const page = await stage.open(`${relay.url}/#/r/demo?joint=NOPE&eye=1,2,x&theme=pink&angle=turns`);
    await until('LIVE', is(page, 'LIVE'));
    await until('put right', async () => (await hash(page)) === '#/r/demo');
    expect(await page.findByTestId('joint-card').count()).toBe(0);
    await page.press('?');
    await until('the keys', async () => (await page.findByTestId('keys').count()) === 1);
    await page.screenshot('keys-laptop.png');
    const kept = (await page.findByTestId('keys').text()) ?? '';
    for (const key of ['t', 's', 'p', 'f', 'j', '?']) await page.press(key);
    expect(await page.findByTestId('share').count(), 'nothing opens over a dialog').toBe(0);
    expect(await page.findByTestId('robot-page').attribute('data-present')).toBe('false');
    expect(await page.findByTestId('keys').text()).toBe(kept);
    await page.press('Escape');
    await until('gone', async () => (await page.findByTestId('keys').count()) === 0);
    const isOpen = () =>
      page.evaluate<string>(`document.querySelector('header.top .wide-only').getAttribute('aria-pressed')`);
    const before = await isOpen();
    await page.evaluate(`document.body.dispatchEvent(new KeyboardEvent('keydown',
      { key: 'ㅅ', code: 'KeyT', bubbles: true, cancelable: true }))`);
    await until('T of a Hangul keyboard', async () => (await isOpen()) !== before);
  });
});

describe('a frame in a page of another origin', () => {
  it('starts when it is seen, tells the page around it how the robot is, and needs no storage', async () => {
    const relay = await demo();
    const course = await Host.open(REPO);
    try {
      const frame = `${relay.url}/embed/demo?origin=${course.url}#/r/demo?theme=light`;
      course.instead.set(
        '/course.html',
        `<!doctype html><title>Week 3</title><link rel="icon" href="data:,"><body style="margin:0;height:3000px">
        <h1 style="margin-top:1500px">The robot</h1><iframe src="${frame}" title="Robot" width="640" height="400"></iframe>
        <script>window.told = []; addEventListener('message', (e) => told.push({ origin: e.origin, ...e.data }))</script>`,
      );
      const page = await stage.newPage({
        viewport: { width: 800, height: 600 },
        // as in a frame in which the browser stores nothing
        preload: `if (window.parent !== window) Object.defineProperty(window, 'localStorage', { get() { throw new Error('no') } })`,
      });
      page.allow(relay.host);
      await page.open(`${course.url}/course.html`);
      const asked = (pattern: RegExp) => page.requested.some((url) => pattern.test(url));
      await until('the frame itself', async () => asked(/EmbedPage/));
      expect(asked(/\/api\//), 'nothing before it is on the screen').toBe(false);

      await page.evaluate('scrollTo(0, 1400)');
      const told = () => page.evaluate<Record<string, unknown>[]>('window.told');
      await until('ready', async () => (await told()).some(({ posecast }) => posecast === 'ready'));
      await until('LIVE', async () => (await told()).some(({ word }) => word === 'LIVE'));
      const live = (await told()).find(({ word }) => word === 'LIVE');
      expect(live).toMatchObject({ origin: relay.url, posecast: 'liveness', robot: 'demo', cause: null });
      await until('its model', async () => asked(/manifest\.json/));
      await page.evaluate(`frames[0].postMessage({ posecast: 'look', view: 'side' }, '*')`);
      await page.evaluate(`frames[0].postMessage({ posecast: 'set', theme: 'dark' }, '*')`);
      await page.evaluate(`new Promise((then) => setTimeout(then, 1500))`);
      await page.screenshot('embed.png');
    } finally {
      await course.close();
    }
  });

  it('stays empty in a page that the robot may not be framed by', async () => {
    const robots = path.join(stage.stack.folder(), 'robots.toml');
    const rules = `[robots.open.anyone]\n[robots.demo.anyone]\nframes = ["https://course.example"]\n`;
    writeFileSync(robots, rules, { mode: 0o600 });
    const relay = await stage.stack.relay({ robots });
    const other = await Host.open(REPO);
    try {
      const frame = (address: string) =>
        `<iframe src="${relay.url}/embed/${address}" onload="loaded.push('${address}')"></iframe>`;
      other.instead.set(
        '/other.html',
        `<!doctype html><title>x</title><link rel="icon" href="data:,"><script>window.loaded = []</script>
        ${['open', 'demo', '#/r/demo'].map(frame).join('')}`,
      );
      const page = await stage.newPage();
      page.allow(relay.host);
      page.forgive(/frame/i);
      await page.open(`${other.url}/other.html`);
      await until('all have come or been refused', async () => {
        return (await page.evaluate<string[]>('loaded')).length === 3;
      });
      const named = (what: RegExp) => page.requested.filter((url) => what.test(url)).length;
      await until('the first one runs', async () => named(/EmbedPage/) > 0);
      // a running frame requests this once, whatever is in its cache
      expect(named(/config\.json/)).toBe(1);
    } finally {
      await other.close();
    }
  });

  it('is silent towards any other page', async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, STANDING);
    const other = await Host.open(REPO);
    try {
      other.instead.set(
        '/other.html',
        `<!doctype html><title>x</title><link rel="icon" href="data:,"><iframe src="${relay.url}/embed/demo?origin=https://course.example#/r/demo"></iframe>
        <script>window.told = []; addEventListener('message', (e) => told.push(e.data))</script>`,
      );
      const page = await stage.newPage();
      page.allow(relay.host);
      page.forgive(/target origin provided/);
      await page.open(`${other.url}/other.html`);
      await until('someone watches', async () => {
        const { viewers } = (await relay.json('/api/v1/robots/demo')) as { viewers: number };
        return viewers === 1;
      });
      expect(await page.evaluate('window.told')).toEqual([]);
    } finally {
      await other.close();
    }
  });
});
