import path from 'node:path';
import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { englishLeft, wordsOf } from './english_left.ts';
import { chips, gone, hasSkin, holds, is, RECORD, there } from './robot_page.ts';
import { DEMO, demoAt } from './sign_words.ts';
import { REPO, type Relay } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const BUNDLE = path.join(REPO, 'edge-agent/src/posecast_edge/demo_bundle');
/** Every part of the settings. */
const OPEN_ALL = `[...document.querySelectorAll('dialog details')].map((part) => { part.open = true; })`;
const LAPTOP = { width: 1280, height: 800 };
const PHONE = { width: 390, height: 844 };
const KOREAN = `Object.defineProperty(navigator, 'languages', { get: () => ['ko-KR', 'en'] })`;
const lang = (page: Page) => page.evaluate<string>('document.documentElement.lang');
interface Described {
  readonly name: string;
  readonly schema: {
    readonly labels: Readonly<Record<string, readonly string[]>>;
    readonly fields: readonly { readonly bits?: readonly string[] }[];
    readonly mapping: {
      readonly names?: Readonly<Record<string, string>>;
      readonly sensors?: Readonly<Record<string, { readonly name?: string }>>;
    };
  };
}

/** Parts that load late may show English for a moment before they switch to Korean. */
async function settledEnglish(page: Page, known: ReadonlySet<string>): Promise<string[]> {
  const untilMs = performance.now() + 10_000;
  for (;;) {
    const found = await englishLeft(page, known);
    if (found.length === 0 || performance.now() > untilMs) return found;
    await new Promise((resolve) => setTimeout(resolve, 200));
  }
}

/** The robot's own words, which are the same in every language. */
async function namesOf(relay: Relay): Promise<Set<string>> {
  const { name, schema } = (await relay.json('/api/v1/robots/demo')) as Described;
  const { labels, fields, mapping } = schema;
  const said = [
    ...[name, 'demo'],
    ...Object.values(labels).flat(),
    ...fields.flatMap(({ bits }) => bits ?? []),
    ...Object.values(mapping.names ?? {}),
    ...Object.values(mapping.sensors ?? {}).map(({ name: called }) => called ?? ''),
  ];
  return new Set(said.flatMap(wordsOf));
}

const has = (page: Page, id: string) => until(id, there(page, id));

it.skipIf(!FULL)(
  'the page speaks Korean to a browser that does, and what is chosen goes before it, without a pause in the stream',
  async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, { pos: { RKN: 0 }, wave: { pos: { RKN: [0.4, 0.5] } } });
    const page = await stage.open(`${relay.url}/#/`, { preload: `${RECORD}; ${KOREAN}` });
    await until('the list', async () => (await page.text()).includes('방송 중'));
    expect(await lang(page)).toBe('ko');
    await has(page, 'robot-demo');
    await page.findByTestId('robot-demo').click();
    await until('LIVE', is(page, 'LIVE'));
    const head = () => page.evaluate<string>('document.querySelector(".joints thead")?.textContent ?? ""');
    await until('a Korean table', async () => (await head()).includes('위치'));

    const before = (await chips(page)).length;
    await page.findByRole('button', '설정').click();
    await has(page, 'settings');
    await page.evaluate(
      `[...document.querySelectorAll('input[name=language]')].find((i) => i.parentElement.textContent === 'English').click()`,
    );
    await until('English', async () => (await page.findByTestId('settings').text()).includes('Theme'));
    await until('an English table', async () => (await head()).includes('pos'));
    expect(await lang(page)).toBe('en');
    await page.press('Escape');
    expect(await page.findByRole('button', 'Settings').count()).toBe(1);
    expect((await chips(page)).slice(before), 'nothing has happened to the stream').toEqual([]);
    await page.open(`${relay.url}/?again#/r/demo`);
    await until('LIVE', is(page, 'LIVE'));
    expect(await lang(page), 'kept').toBe('en');
  },
);

it.skipIf(!FULL)(
  'in Korean nothing is left in English but names, units and the four words',
  async () => {
    const relay = await stage.stack.relay();
    const { source } = stage.stack.fedEdge(relay, demoAt(42), DEMO);
    const page = await stage.newPage({ preload: KOREAN, viewport: LAPTOP });
    const left: Record<string, string[]> = {};
    const robots = () => relay.json('/api/v1/robots');
    await until('the robot', async () => JSON.stringify(await robots()).includes('"online"'));
    const known = await namesOf(relay);
    const look = async (where: string) => {
      const found = await settledEnglish(page, known);
      if (found.length > 0) left[where] = found;
    };
    const tab = (name: string) => page.evaluate(`document.getElementById('tab-${name}').click()`);
    const shot = (name: string) => page.screenshot(`korean-${name}.png`);

    await page.open(`${relay.url}/#/`);
    await has(page, 'robot-demo');
    await look('list');
    await page.open(`${relay.url}/#/r/demo`);
    await until('a body', () => hasSkin(page));
    await has(page, 'spoken');
    await until('its filter', holds(page, 'document.querySelector(".filter") !== null'));
    await look('body and table');
    await shot('laptop');
    await page.findByTestId('limbs').click();
    await until('limbs', holds(page, 'document.querySelector("tr.limb") !== null'));
    await look('limbs');
    await page.findByTestId('filter').type('zzz');
    known.add('zzz');
    await look('a filter that finds nothing');
    await page.findByTestId('filter').type('');

    await page.findByTestId('liveness').click();
    await until('why', async () => (await page.findByTestId('liveness-explained').text()) !== '');
    await look('behind the chip');
    await page.press('Escape');
    await page.evaluate('document.querySelector("[data-testid=signs] button").click()');
    await has(page, 'sign-menu');
    await look('menu of signs');
    await page.evaluate('[...document.querySelectorAll("input[name=load]")].at(-1).click()');
    await has(page, 'load-legend');
    await look('legend');
    await page.evaluate('document.querySelector("input[name=load]").click()');
    await page.press('Escape');

    await page.evaluate(`document.querySelector('tr[data-label="RKN"] button').click()`);
    await has(page, 'joint-card');
    await until('its plot', there(page, 'plot-pos'));
    await look('card');
    await shot('card');
    for (const field of ['pos', 'ref', 'error', 'cur', 'temp'])
      await page.findByTestId(`plot-${field}`).click();
    await page.press('Escape');
    for (const name of ['Sensors', 'Plots', 'Alarms']) {
      await tab(name);
      await until(name, holds(page, `document.querySelector('#panel-${name} :is(td, canvas, li)') !== null`));
      await look(name);
      await shot(name.toLowerCase());
    }
    await page.findByTestId('acknowledge').click();
    await look('acknowledged');
    await tab('Joints');
    for (const [name, key] of [
      ['share', 's'],
      ['keys', '?'],
    ] as const) {
      await page.press(key);
      await has(page, name);
      await look(name);
      await page.press('Escape');
      await until('gone', gone(page, name));
    }
    await page.findByRole('button', '설정').click();
    await has(page, 'limits');
    await page.evaluate(OPEN_ALL);
    await look('settings');
    await shot('settings');
    await page.press('Escape');
    await page.viewport(PHONE);
    await look('phone');
    await shot('phone');
    await page.viewport(LAPTOP);

    // temperatures fall silent, a joint stalls without a flag, then everything stops
    const { temp: _, ...rest } = demoAt(1);
    source.write(JSON.stringify({ ...rest, ref: { ...rest.ref, RSP: (rest.pos?.RSP ?? 0) + 0.4 } }));
    await until('the stalled joint', async () => /RSP/.test(await page.findByTestId('fault-line').text()));
    await until(
      'their age',
      holds(page, `/전 값/.test(document.querySelector('tr[data-label="RSP"] .c-flags').textContent)`),
    );
    await look('silent and stalled');
    await shot('stalled');
    source.signal('SIGSTOP');
    await until('STALE', is(page, 'STALE'));
    await look('STALE');
    await relay.process.kill();
    await until(
      'no connection',
      holds(page, `document.querySelector('[data-testid=liveness]').dataset.cause === 'no connection'`),
    );
    await look('no connection');
    page.forgive(/WebSocket|ERR_CONNECTION|Failed to (load|fetch)/);
    expect(left).toEqual({});
  },
  300_000,
);

it.skipIf(!FULL)(
  'nor where there is no robot, in a frame, and side by side',
  async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, demoAt(1), DEMO);
    stage.stack.fedEdge(relay, demoAt(1), { ...DEMO, robot: 'other' });
    const page = await stage.newPage({ preload: KOREAN, viewport: LAPTOP });
    const left: Record<string, string[]> = {};
    const known = new Set(['demo', 'other']);
    const look = async (where: string) => {
      const found = await settledEnglish(page, known);
      if (found.length > 0) left[where] = found;
    };
    await page.open(`${relay.url}/#/r/nobody`);
    known.add('nobody');
    await until('OFFLINE', is(page, 'OFFLINE'));
    await look('nobody');
    await page.open(`${relay.url}/?1#/nowhere`);
    known.add('nowhere');
    await until('nothing', async () => (await page.text()).includes('/nowhere'));
    await look('nowhere');
    await page.open(`${relay.url}/?2&relay=https://evil.example#/`);
    await has(page, 'relay-refused');
    known.add('relay').add('evil').add('example');
    await look('refused');
    await page.open(`${relay.url}/?3#/r/demo+other`);
    await until('two', holds(page, '(window.posecast?.scene?.robots?.length ?? 0) === 2'));
    await until(
      'names',
      async () =>
        (await page.findByTestId('line-other').text()).includes('LIVE') ||
        (await page.findByTestId('line-other').text()).includes('HOLDING'),
    );
    for (const word of await namesOf(relay)) known.add(word);
    await look('side by side');
    await page.open(`${relay.url}/embed/?4#/r/demo`);
    await until('a body', () => hasSkin(page));
    await look('embed');
    expect(left).toEqual({});
  },
  300_000,
);

it.skipIf(!FULL)(
  'nor at a robot from this computer',
  async (context) => {
    stage.needs(context, 'files');
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, demoAt(1), DEMO);
    const page = await stage.newPage({ preload: KOREAN, viewport: LAPTOP });
    const left: Record<string, string[]> = {};
    await page.open(`${relay.url}/#/`);
    await has(page, 'robot-demo');
    const known = await namesOf(relay);
    const look = async (where: string) => {
      const found = await settledEnglish(page, known);
      if (found.length > 0) left[where] = found;
    };
    await page.dropFiles({ x: 600, y: 400 }, [path.join(REPO, 'README.md')]);
    await has(page, 'drop-refused');
    await look('refused files');
    await page.dropFiles({ x: 600, y: 400 }, [BUNDLE]);
    await has(page, 'local-page');
    await until('a body', () => hasSkin(page));
    // The doctor's findings use the words of `posecast-edge doctor`, so that people can search for them.
    await page.evaluate(
      '[...document.querySelectorAll("[data-testid=findings] li")].map((item) => item.remove())',
    );
    for (const word of await page.evaluate<string[]>(
      '[...document.querySelectorAll(".local-slider > span, .robot-name")].map((name) => name.textContent)',
    ))
      for (const part of wordsOf(word)) known.add(part);
    await look('a robot from this computer');
    expect(left).toEqual({});
  },
  300_000,
);
