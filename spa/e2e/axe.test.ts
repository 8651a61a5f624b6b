import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { violations } from './axe.ts';
import type { Page, PageOptions } from './driver/page.ts';
import { until } from './driver/until.ts';
import { LOOKS, SIZES, showIn } from './layout/sizes.ts';
import { gone, hasSkin, holds, resting } from './robot_page.ts';
import { DEMO, demoAt } from './sign_words.ts';
import { REPO, type Relay } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const PHONE = { width: 390, height: 844 };
const LAPTOP = { width: 1280, height: 800 };
/** Every part of the settings. */
const OPEN_ALL = `[...document.querySelectorAll('dialog details')].map((part) => { part.open = true; })`;
const BUNDLE = path.join(REPO, 'edge-agent/src/posecast_edge/demo_bundle');

/** The demo robot with its jammed knee, standing still: faults, cautions, a ghost, and no pictures to draw. */
async function jammed(): Promise<Relay> {
  const relay = await stage.stack.relay();
  stage.stack.fedEdge(relay, demoAt(42), DEMO);
  return relay;
}

/** Visits one place after another; returns axe's findings for each. */
class Looks {
  readonly found: Record<string, string[]> = {};
  readonly page: Page;

  private constructor(page: Page) {
    this.page = page;
  }

  static async open(options: PageOptions): Promise<Looks> {
    return new Looks(await stage.newPage(options));
  }

  async at(where: string): Promise<void> {
    const wrong = await violations(this.page);
    if (wrong.length > 0) this.found[where] = wrong;
  }

  async testId(id: string): Promise<void> {
    await until(id, async () => (await this.page.findByTestId(id).count()) === 1);
  }

  async list(relay: Relay): Promise<void> {
    await this.page.open(`${relay.url}/#/`);
    await this.testId('robot-demo');
    await this.at('list');
  }

  async robot(relay: Relay): Promise<void> {
    await this.page.open(`${relay.url}/#/r/demo`);
    await until('a body', () => hasSkin(this.page));
    await until('its buttons and its row', () =>
      this.page.evaluate<boolean>(
        `document.querySelector('[data-testid=signs]') !== null && document.querySelector('.filter') !== null
          && document.querySelector('tr[data-level=fault]') !== null`,
      ),
    );
    await until('at rest', () => resting(this.page));
    await this.at('body and table');
  }

  /** Looks back from the current place. */
  async past(): Promise<void> {
    await this.testId('track');
    await this.page.findByTestId('play').click();
    await this.testId('transport');
    await until('it has opened', () => this.page.evaluate<boolean>('document.getAnimations().length === 0'));
    await this.at('past');
    await this.page.findByTestId('jump').click();
    await this.testId('moment-days');
    await this.at('moments');
    await this.page.evaluate(`document.querySelectorAll('.moment-ways input')[1].click()`);
    await this.testId('incidents');
    await this.at('last faults');
    await this.page.press('Escape');
  }

  async embed(relay: Relay): Promise<void> {
    await this.page.open(`${relay.url}/embed/#/r/demo`);
    await until('a body', () => hasSkin(this.page));
    await until('at rest', () => resting(this.page));
    await this.at('embed');
  }
}

describe('axe finds nothing', () => {
  it('on the list, at body and table, in a frame', async () => {
    const relay = await jammed();
    const looks = await Looks.open({ viewport: LAPTOP });
    await looks.list(relay);
    await looks.robot(relay);
    await looks.past();
    await looks.embed(relay);
    expect(looks.found).toEqual({});
  }, 180_000);

  it('at every size, in both languages and themes', { timeout: 600_000 }, async (context) => {
    if (!FULL) context.skip('make test-full plays it');
    const relay = await jammed();
    const preload = `try { localStorage.setItem('posecast.settings', '{"body":"light"}') } catch {}`;
    const looks = await Looks.open({ viewport: LAPTOP, preload, media: { motion: 'reduce' } });
    const { page } = looks;
    const click = (id: string) => page.evaluate(`document.getElementById('${id}').click()`);
    const has = (selector: string) => () =>
      page.evaluate<boolean>(`document.querySelector('${selector}') !== null`);
    const tab = (name: string) => async () => {
      await page.open(`${relay.url}/#/r/demo`);
      await until('the panel', has('[data-testid=fault-line][data-told]'));
      await click(`tab-${name}`);
      await until(name, has(`#panel-${name}`));
    };
    const places: Record<string, () => Promise<unknown>> = {
      list: async () => {
        await page.open(`${relay.url}/#/`);
        await looks.testId('robot-demo');
      },
      joints: tab('Joints'),
      sensors: tab('Sensors'),
      alarms: tab('Alarms'),
      embed: () => page.open(`${relay.url}/embed/#/r/demo`).then(() => looks.testId('liveness')),
      present: () => page.open(`${relay.url}/#/r/demo?present`).then(() => looks.testId('presentation')),
      past: async () => {
        await page.open(`${relay.url}/#/r/demo`);
        await looks.past();
      },
      'no such robot': () => page.open(`${relay.url}/#/r/nobody`).then(() => looks.testId('liveness')),
    };
    for (const [name, go] of Object.entries(places)) {
      await page.viewport(LAPTOP);
      await go();
      for (const [language, theme] of LOOKS) {
        await showIn(page, language, theme);
        for (const size of SIZES) {
          await page.viewport(size);
          await looks.at(`${name} ${size.width}×${size.height} ${language} ${theme}`);
        }
      }
    }
    expect(looks.found).toEqual({});
  });

  interface Manner {
    readonly colors?: 'forced';
    readonly palette?: 'safe';
    readonly language?: 'ko';
  }
  it.for<[scheme: 'dark' | 'light', manner: Manner]>([
    ['dark', {}],
    ['light', {}],
    ['dark', { colors: 'forced' }],
    ['light', { palette: 'safe' }],
    ['dark', { language: 'ko' }],
  ])('wherever one can go: %s %o', { timeout: 400_000 }, async ([scheme, manner], context) => {
    if (!FULL) context.skip('make test-full plays it');
    stage.needs(context, 'media');
    const { colors, ...settings } = manner;
    if (colors !== undefined) stage.needs(context, 'colors');
    const relay = await jammed();
    const looks = await Looks.open({
      viewport: LAPTOP,
      media: { scheme, motion: 'reduce', ...(colors === undefined ? {} : { colors }) },
      // the empty page before the first one has no storage
      preload: `try { localStorage.setItem('posecast.settings', '${JSON.stringify({ body: '3d', ...settings })}') } catch {}`,
    });
    const { page } = looks;
    const tab = (name: string) => page.evaluate(`document.getElementById('tab-${name}').click()`);
    await looks.list(relay);
    await looks.robot(relay);
    await looks.testId('spoken');

    await page.findByTestId('liveness').click();
    await until('why', async () => (await page.findByTestId('liveness-explained').text()) !== '');
    await looks.at('what stands behind the chip');
    await page.press('Escape');
    await page.evaluate('document.querySelector("[data-testid=signs] button").click()');
    await looks.testId('sign-menu');
    await looks.at('the menu of signs');
    await page.press('Escape');

    await page.evaluate(`document.querySelector('tr[data-label="RKN"] button').click()`);
    await looks.testId('joint-card');
    await page.findByTestId('plot-pos').click();
    await page.findByTestId('plot-cur').click();
    await looks.at('a card');
    await page.press('Escape');
    for (const name of ['Sensors', 'Plots', 'Alarms']) {
      await tab(name);
      await until(name, holds(page, `document.querySelector('#panel-${name} :is(td, canvas, li)') !== null`));
      await looks.at(name);
    }
    for (const [name, key] of [
      ['share', 's'],
      ['keys', '?'],
    ] as const) {
      await page.press(key);
      await looks.testId(name);
      await looks.at(name);
      await page.press('Escape');
      await until('gone', gone(page, name));
    }
    await page.evaluate('[...document.querySelectorAll("header.top .icon-button")].at(-1).click()');
    await looks.testId('limits');
    await page.evaluate(OPEN_ALL);
    await looks.at('settings');
    await page.press('Escape');
    await tab('Joints');
    await page.viewport(PHONE);
    await looks.at('phone');
    await page.viewport(LAPTOP);

    await page.open(`${relay.url}/#/nowhere`);
    await until('said so', async () => (await page.text()).includes('/nowhere'));
    await looks.at('an address that names nothing');
    await looks.embed(relay);
    await page.open(`${relay.url}/#/`);
    if (stage.browser.lacks.files === undefined) {
      await looks.testId('robot-demo');
      await page.dropFiles({ x: 600, y: 400 }, [BUNDLE]);
      await looks.testId('local-page');
      await until('a body', () => hasSkin(page));
      await looks.at('a robot from this computer');
    }
    expect(looks.found).toEqual({});
  });
});
