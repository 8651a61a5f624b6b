import { afterEach, beforeEach, describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { Gate, type OwnAnswer } from './gate.ts';
import { is } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const KOREAN = `Object.defineProperty(navigator, 'language', { value: 'ko-KR' })`;

describe('a page that is opened while its proxy restarts', () => {
  let gate: Gate;
  beforeEach(async () => {
    gate = await Gate.open((await stage.demo()).port);
  });
  afterEach(() => gate.close());

  it.each<[string, string, RegExp, 'reset' | OwnAnswer, string, RegExp]>([
    [
      'refuses connections',
      '/#/r/demo',
      /\/assets\//,
      'reset',
      '',
      /This page did not load\. Trying again\./,
    ],
    ['has no relay', '/embed/demo', /\/assets\//, { status: 502 }, KOREAN, /페이지를 불러오지 못했습니다\./],
    ['has some files', '/r/demo', /\/assets\/early-/, { status: 502 }, '', /This page did not load/],
  ])('and %s says so, and comes by itself', async (name, at, missing, answer, preload, sentence) => {
    gate.answer = ({ url = '' }) => (missing.test(url) ? answer : null);
    const page = await stage.newPage({ preload });
    page.forgive(/status of 502|MIME type/);
    await page.open(`${gate.url}${at}`);
    await until('it says so', async () => sentence.test(await page.text()));
    await page.screenshot(`not-loaded-${name.replaceAll(' ', '-')}.png`);
    const before = page.requested.length;
    await until('it tries again', async () => page.requested.length > before);
    gate.answer = () => null;
    await until('LIVE', is(page, 'LIVE'));
    expect(await page.text()).not.toMatch(sentence);
  });

  it('gets its looks later, if only those were missing', async () => {
    let refused = 0;
    gate.answer = ({ url = '' }) => {
      if (!/index-.*\.css/.test(url)) return null;
      refused += 1;
      return refused > 1 ? null : 'reset';
    };
    const page = await stage.open(`${gate.url}/#/r/demo`);
    const chip = `getComputedStyle(document.querySelector('.robot-page')).display`;
    await until('LIVE', is(page, 'LIVE'));
    await until('its looks', async () => (await page.evaluate<string>(chip)) !== 'block');
    expect(refused).toBe(2);
  });
});
