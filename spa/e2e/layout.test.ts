import { rmSync } from 'node:fs';
import path from 'node:path';
import { expect, it, onTestFinished } from 'vitest';
import { moreKo } from '../src/app/text/ko.ts';
import { moreEn } from '../src/app/text/more_en.ts';
import { engineName } from './driver/engines.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { exportPast } from './exported.ts';
import { Host } from './host.ts';
import { tooSmall } from './layout/legible.ts';
import { CHOSEN, noticedRobot, openNoticed } from './layout/noticed.ts';
import { type Language, lookEverywhere, SIZES, Wrongs } from './layout/sizes.ts';
import { holds, is, there } from './robot_page.ts';
import { DEMO, demoAt } from './sign_words.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();
/** The sizes covered by a normal run: a phone in both orientations, and a laptop. */
const USUAL = [390, 844, 1440];
const PLAYED = SIZES.filter(({ width }) =>
  engineName() === 'chromium' ? FULL || USUAL.includes(width) : width === 390 || width === 1440,
);
const NARROW = PLAYED.filter(({ width }) => width < 400);
const TWO = PLAYED.filter(({ width }) => width === 390 || width === 1366 || width === 1440).slice(0, 2);

/** A browser with data saving on prefetches nothing, so a part is missing once the relay is unreachable. */
const SAVES_DATA = `Object.defineProperty(navigator, 'connection', { value: { saveData: true } })`;

const has = (page: Page, id: string) => until(id, there(page, id));
const tab = (page: Page, name: string) => page.evaluate(`document.getElementById('tab-${name}').click()`);

it('nothing on the page of a robot lies over anything else, whatever there is to say', async () => {
  const robot = await noticedRobot(stage.stack);
  const { relay, source } = robot;
  const page = await stage.newPage({ preload: `${CHOSEN};${SAVES_DATA}`, media: { motion: 'reduce' } });
  const wrongs = new Wrongs();
  onTestFinished(() => console.info(wrongs.lines.join('\n')));
  /** The longest possible text of this note; the reasons differ by device. */
  const slow = async (language: Language) => {
    const words = (language === 'ko' ? moreKo : moreEn).viewGivenUp;
    await page.evaluate(
      `document.querySelector('[data-testid=view-note]').firstChild.data = ${JSON.stringify(words)}`,
    );
  };
  await openNoticed(page, robot);
  await lookEverywhere(page, 'LIVE', wrongs, NARROW, slow);
  source.signal('SIGSTOP'); // a moving robot is redrawn all the time, which would slow down every size
  await until('STALE', is(page, 'STALE'));
  for (const name of ['Sensors', 'Alarms', 'Plots']) {
    await tab(page, name);
    await until(name, holds(page, `document.querySelector('#panel-${name} > *') !== null`));
    await lookEverywhere(page, name, wrongs, TWO, slow);
  }
  await tab(page, 'Joints');
  await page.evaluate(`document.querySelector('tr[data-label="RKN"] button').click()`);
  await has(page, 'joint-card');
  await lookEverywhere(page, 'card', wrongs, TWO, slow);
  await page.press('Escape');

  await page.findByTestId('play').click();
  await until('PAST', is(page, 'PAST'));
  await lookEverywhere(page, 'past', wrongs, PLAYED, slow);
  await page.findByTestId('to-live').click();
  await until('STALE', is(page, 'STALE'));

  await page.findByTestId('jump').click();
  for (const [i, part] of ['moment-days', 'incidents'].entries()) {
    await until(
      part,
      holds(
        page,
        `document.querySelectorAll('.moment-ways input')[${i}]?.click() !== null
        && document.querySelector('[data-testid=${part}]') !== null`,
      ),
    );
    const some = PLAYED.filter(({ width }) => [360, 844, 1440].includes(width));
    await lookEverywhere(page, part, wrongs, some);
  }
  await page.press('Escape');

  await relay.process.kill();
  await until(
    'no connection',
    holds(page, `document.querySelector('[data-testid=liveness]').dataset.cause === 'no connection'`),
  );
  await page.press('?'); // a part that has not been loaded yet
  await has(page, 'not-here');
  await lookEverywhere(page, 'no connection', wrongs, PLAYED, slow);
  page.forgive(/WebSocket|ERR_CONNECTION|Failed to (load|fetch)/);
  expect(wrongs.lines).toEqual([]);
}, 400_000);

it('nor on the other pages', async () => {
  const relay = await stage.stack.relay();
  const still = demoAt(1);
  const long = { pos: { left_shoulder_pitch_joint: 0.1, left_shoulder_roll_joint: 0.2, gripper: 0 } };
  stage.stack.fedEdge(relay, still, { ...DEMO, robot: 'left' });
  stage.stack.fedEdge(relay, still, { ...DEMO, robot: 'right' });
  stage.stack.fedEdge(relay, long, { robot: 'a-robot-with-quite-a-long-name-and-no-model' });
  const page = await stage.newPage({ preload: CHOSEN, media: { motion: 'reduce' } });
  const wrongs = new Wrongs();
  onTestFinished(() => console.info(wrongs.lines.join('\n')));
  const some = PLAYED.filter(({ width }) => [360, 390, 844, 1440].includes(width));
  for (const [what, address, there, sizes] of [
    // what differs after the # alone needs no reload
    ['list', '?as=anyone#/', '[data-testid=robot-left]', PLAYED],
    ['nobody', '?as=anyone#/r/nobody', '[data-testid=stage-note]', some],
    [
      'no model',
      '?as=anyone#/r/a-robot-with-quite-a-long-name-and-no-model',
      '[data-testid=self-plots]',
      some,
    ],
    ['side by side', '?2#/r/left+right', '.stage-tools', some],
    ['nothing here', '?2#/nowhere', '.broken', PLAYED],
    ['refused', '?relay=https://elsewhere.example#/', '[data-testid=relay-refused]', PLAYED],
    ['embed', 'embed/left?as=anyone#/r/left', '[data-testid=level]:not([hidden])', some],
  ] as const) {
    await page.open(`${relay.url}/${address}`);
    await until(what, holds(page, `document.querySelector('${there}') !== null`));
    await lookEverywhere(page, what, wrongs, sizes);
  }
  expect(wrongs.lines).toEqual([]);
}, 400_000);

it.skipIf(!FULL)(
  'nor on the page of a recording, with notes as near to each other as they may be and parts that are lost',
  async () => {
    const relay = await stage.stack.relay({ past: 'memory:' });
    stage.stack.edge(relay, { model: DEMO.model }); // its faults begin at 20 s, and at 32
    const long = 'Here the right knee is pushed, and what follows is told at some length. '.repeat(10);
    const lecture = await exportPast(stage.stack, relay, 45, {
      title: 'How a robot keeps its balance when it is pushed from behind',
      author: 'A. Lecturer',
      licence: 'CC BY 4.0',
      notes: [
        [1, 'The hip moves before the foot does.'],
        [18, 'Look at the knee.'],
        [19, 'And at the ankle.'],
        [33, long],
      ],
    });
    rmSync(path.join(lecture.at, lecture.segments[1]!));
    const host = await Host.open(lecture.at);
    try {
      const page = await stage.newPage({ preload: CHOSEN, media: { motion: 'reduce' } });
      page.forgive(/404/);
      const wrongs = new Wrongs();
      onTestFinished(() => console.info(wrongs.lines.join('\n')));
      await page.open(`${host.url}/#/`);
      await has(page, 'note-mark');
      await has(page, 'level');
      await page.evaluate(`[...document.querySelectorAll('[data-testid=note-mark]')].at(-1).click()`);
      await until(
        'its words',
        holds(page, `document.querySelector('[data-testid=note-caption]').textContent.length > 100`),
      );
      await page.press('Home');
      for (let i = 0; i < 3; i += 1) await page.press('l'); // over the part that failed to load
      await page.evaluate(`[...document.querySelectorAll('[data-testid=note-mark]')].at(-1).click()`);
      await lookEverywhere(page, 'recording', wrongs, PLAYED);
      await page.viewport({ width: 1440, height: 900 });
      await until(
        'a button that opens it',
        holds(
          page,
          `(() => {
        document.querySelector('[data-testid=note-caption] button')?.focus();
        return document.activeElement.matches('[data-testid=note-caption] button');
      })()`,
        ),
      );
      await page.press('Enter');
      await until(
        'all of it',
        holds(
          page,
          `(() => {
        const caption = document.querySelector('[data-testid=note-caption]');
        const range = document.createRange();
        range.selectNodeContents(caption);
        return range.getBoundingClientRect().bottom <= caption.getBoundingClientRect().bottom;
      })()`,
        ),
      );
      await lookEverywhere(page, 'an opened note', wrongs, TWO);
      await page.press('Escape');
      await page.press('p');
      await has(page, 'present-note');
      await until('in the address', holds(page, '/present/.test(location.hash)'));
      await lookEverywhere(page, 'a presented recording', wrongs, PLAYED);
      expect(await tooSmall(page)).toEqual([]);
      await page.viewport({ width: 390, height: 844 });
      const bodyPx = () => page.evaluate<number>(`document.querySelector('.stage').clientHeight`);
      await until('room for the body', async () => (await bodyPx()) > 150);
      await page.screenshot('recording-presented-long.png');
      await page.press('p');
      await page.findByTestId('about-button').click();
      await has(page, 'about-recording');
      await lookEverywhere(page, 'about a recording', wrongs, TWO);
      await page.press('Escape');
      await page.open(`${host.url}/embed/index.html?1`);
      await has(page, 'play');
      const noted = new Date(lecture.fromMs + 33_050).toISOString();
      await page.evaluate(`location.hash = '#/?t=${noted}'`);
      await until(
        'its note',
        holds(page, `document.querySelector('[data-testid=note-caption]').textContent.length > 100`),
      );
      await lookEverywhere(page, 'a framed recording', wrongs, [
        ...TWO,
        { width: 640, height: 400 },
        { width: 320, height: 240 },
      ]);
      expect(wrongs.lines).toEqual([]);
    } finally {
      await host.close();
    }
  },
  400_000,
);
