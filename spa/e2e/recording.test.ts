import { existsSync, readFileSync, renameSync, rmSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { expect, it } from 'vitest';
import { freePort } from './driver/free_port.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import type { Exported } from './exported.ts';
import { Host } from './host.ts';
import { isRecorded, LAPTOP, NEAR_MS, newPage, setLecture, TOLD } from './recording_page.ts';
import { chipText, gone, holds, liveness, testId, textOf, there } from './robot_page.ts';
import { FULL, setStage } from './stage.ts';
import { shown, stepToFrame, WITNESS } from './truth.ts';

/** In the light view, which draws often. */
const stage = setStage({ webgl: false });
const shared = setLecture(24);

const NGINX = '/usr/sbin/nginx';
const PREFIX = '/~somebody/lecture/';
const PHONE = { width: 390, height: 844 };

const atEnd =
  (page: Page, { toMs }: Exported) =>
  async () =>
    (await shown(page)).momentMs === toMs;
const playName = (page: Page) => page.evaluate<string>(`${testId('play')}.ariaLabel`);

/** The colour of the table's numbers, and of out-of-date values. */
const numberColors = (page: Page) =>
  page.evaluate<[string, string]>(`(() => {
    const probe = document.body.appendChild(document.createElement('i'));
    probe.style.color = 'var(--stale)';
    const colors = [document.querySelector('.joints td'), probe].map((element) => getComputedStyle(element).color);
    probe.remove();
    return colors;
  })()`);

/** The page's requests other than its own files. */
const askedOf = (page: Page) =>
  page.requested
    .map((url) => new URL(url).pathname)
    .filter((name) => !/\/assets\/|\/$|index\.html$|favicon|icon-|webmanifest/.test(name));

/** Checks that data.csv and data.mcap of a folder are linked in a part of the page, with their sizes. */
async function offersFiles(page: Page, id: string, { at }: Exported): Promise<void> {
  const links = await page.evaluate<[href: string, name: string, text: string][]>(
    `[...${testId(id)}.querySelectorAll('a[download]')].map((a) => [a.href, a.download, a.textContent])`,
  );
  expect(links.map(([, name]) => name)).toEqual(['demo.csv', 'demo.mcap']);
  for (const [href, , text] of links) {
    const file = readFileSync(path.join(at, path.basename(href)));
    expect(Buffer.from(await (await fetch(href)).arrayBuffer()).equals(file), href).toBe(true);
    expect(text).toMatch(file.length < 1e6 ? /^(CSV|MCAP) \(\d+ kB\)$/ : /^(CSV|MCAP) \([\d.]+ MB\)$/);
  }
}

it.each(FULL ? [LAPTOP, PHONE] : [PHONE])(
  'an export plays on a host of plain files, below a path, at $width px',
  async (viewport) => {
    const lecture = shared.copy(stage.stack);
    const host = await Host.open(lecture.at, PREFIX);
    try {
      const page = await newPage(stage, viewport, WITNESS);
      await page.open(`${host.url}${PREFIX}`);
      await isRecorded(page);
      await until('its first pose', async () => {
        const { momentMs } = await shown(page);
        return momentMs !== null && momentMs - lecture.fromMs < 1000;
      });
      const asked = askedOf(page);
      expect(asked.filter((name) => !name.startsWith(PREFIX))).toEqual([]);
      expect(asked.map((name) => name.slice(PREFIX.length).split('/')[0])).toEqual(
        expect.arrayContaining(['recording.json', 'segments', 'models']),
      );
      expect(asked.length, asked.join()).toBeLessThanOrEqual(4);

      // it is labelled as a recording everywhere
      expect(await chipText(page)).toMatch(
        /^RECORDED\d+ [A-Z][a-z]+ 20\d\d \d\d:\d\d:\d\d · 0:00 of 0:[1-4]\d$/,
      );
      expect(await page.evaluate<string>('document.title')).toBe(`RECORDED · ${TOLD.title} · Posecast`);
      expect(await textOf(page, 'stage-note')).toMatch(/^Recorded: \d+ [A-Z][a-z]+ 20\d\d/);
      expect(await page.evaluate<string>('window.posecast.twin.liveness')).toBe('RECORDED');
      await until('a screen reader is told', async () => /recorded/.test(await textOf(page, 'spoken')));
      expect(await page.findByTestId('to-live').count()).toBe(0);
      expect(await page.text()).toContain(TOLD.title);
      await page.screenshot(`recording-${viewport.width}.png`);

      // it plays, also frame by frame, pauses at its end and plays again
      const first = await shown(page);
      await page.press('Space');
      await until('it plays', async () => (await shown(page)).seq > first.seq + 10);
      await page.press('Space');
      await until('it rests', async () => /Play/.test(await playName(page)));
      const rests = await stepToFrame(page);
      expect(rests.offMs).toBeLessThan(NEAR_MS);
      const link = await until('the moment in the address', async () => {
        const href = await page.evaluate<string>('location.href');
        const named = Date.parse(/#\/\?t=([\d:.TZ-]+)/.exec(href)?.[1] ?? '');
        return named === Math.ceil((await shown(page)).momentMs!) ? href : null;
      });
      await page.press('Shift+ArrowRight');
      await page.press('Space');
      await until('its end', atEnd(page, lecture));
      await until('it rests there', async () => /Play/.test(await playName(page)));
      expect(await liveness(page)).toBe('RECORDED');
      await page.press('Space');
      await until('again from the beginning', async () => {
        const { momentMs } = await shown(page);
        return momentMs !== null && momentMs < lecture.fromMs + 8000 && momentMs > lecture.fromMs;
      });
      await page.press('Space');

      // it is presented, and plays meanwhile
      await page.press('p');
      await until('presented', there(page, 'presentation'));
      expect(await textOf(page, 'present-word')).toMatch(/^RECORDED/);
      expect(await textOf(page, 'presentation')).toContain(TOLD.title);
      const still = (await shown(page)).seq;
      await page.press('Space');
      await until('it plays', async () => (await shown(page)).seq > still + 5);
      await page.press('Space');
      await page.press('Escape');
      await until('no longer', gone(page, 'presentation'));

      // notes
      const marks = await page.findByTestId('note-mark').count();
      expect(marks).toBeGreaterThanOrEqual(2);
      await page.evaluate(`[...document.querySelectorAll('[data-testid="note-mark"]')].at(-1).click()`);
      await until('its caption', async () => (await textOf(page, 'note-caption')).includes(TOLD.notes[2][1]));
      expect((await shown(page)).momentMs).toBe(lecture.fromMs + 12_000);
      await page.press('p');
      await until('the note in large', async () => (await textOf(page, 'present-note')) === TOLD.notes[2][1]);
      await page.screenshot(`recording-presented-${viewport.width}.png`);
      await page.press('Escape');
      await until('no longer', gone(page, 'presentation'));
      await page.findByTestId('about-button').click();
      await until('about it', there(page, 'about-recording'));
      const about = await textOf(page, 'about-recording');
      for (const said of [TOLD.author, TOLD.licence, TOLD.notes[1][1]]) expect(about).toContain(said);
      await offersFiles(page, 'about-recording', lecture);
      await page.screenshot(`recording-about-${viewport.width}.png`);
      await page.evaluate(`document.querySelectorAll('[data-testid="go-to-note"]')[1].click()`);
      await until('the note of the list', async () => (await shown(page)).momentMs === lecture.fromMs + 4000);

      // the whole of it for other programs, where one saves
      await page.press('x');
      await until('the sheet', there(page, 'save-offered'));
      await offersFiles(page, 'save-offered', lecture);
      expect(await textOf(page, 'save-mcap')).toContain('posecast convert FILE.posecast OUT.mcap');
      await page.screenshot(`recording-save-${viewport.width}.png`);
      await page.press('Escape');
      await until('no sheet', gone(page, 'save'));

      // a link to a moment, and one to a moment that it does not have
      await page.open('about:blank');
      await page.open(link);
      await isRecorded(page);
      await until('the same frame', async () => (await shown(page)).seq === rests.seq);
      const names = (what: string, moment: RegExp) =>
        until(what, async () => moment.test(await textOf(page, 'past-note')));
      await page.open('about:blank');
      await page.open(`${host.url}${PREFIX}#/?t=2026-01-02T12:00:00.000Z`);
      await isRecorded(page);
      await names('it is said', /2026.* is not in this recording/);
      await page.open(`${host.url}${PREFIX}#/?t=2199-01-02T12:00:00.000Z`);
      await names('of another', /2199.* is not in this recording/);
      await page.open('about:blank'); // a page that is open may still write its own moment into the address
      await page.open(`${host.url}${PREFIX}#/?t=hello`);
      await until('no moment', async () => /names no moment/.test(await textOf(page, 'past-note')));
      await isRecorded(page);
      // the judge itself: a recorded pose that is called live for longer than a glance is a lie
      await until('pictures that would be lies', async () => {
        const seen = await page.evaluate<[number, string, ...(number | null)[]][]>('window.witnessed');
        const forged = seen.map(([atMs, word, ...rest]) => [atMs, word.replace('RECORDED', 'LIVE'), ...rest]);
        const lies = await shared.robot.lies({ evaluate: async () => forged } as never);
        return /LIVE of another moment/.test(lies.join());
      });
      expect(await shared.robot.lies(page)).toEqual([]);
    } finally {
      await host.close();
    }
  },
  240_000,
);

it.skipIf(!FULL || !existsSync(NGINX))(
  'nginx serves it from a folder of its own, knowing nothing of it',
  async () => {
    const lecture = shared.copy(stage.stack);
    const made = stage.stack.folder();
    const port = await freePort();
    const kept = ['client_body', 'proxy', 'fastcgi', 'uwsgi', 'scgi'].map(
      (of) => `${of}_temp_path ${made}/${of};`,
    );
    writeFileSync(
      path.join(made, 'nginx.conf'),
      `${process.getuid?.() === 0 ? 'user root;' : ''} daemon off; pid ${made}/pid; error_log ${made}/errors; events {}
     http { access_log off; ${kept.join(' ')} include /etc/nginx/mime.types;
       server { listen 127.0.0.1:${port}; location /courses/2026/ { alias ${lecture.at}/; } } }`,
    );
    stage.stack.start('nginx', NGINX, ['-e', `${made}/errors`, '-c', path.join(made, 'nginx.conf')]);
    const url = `http://127.0.0.1:${port}/courses/2026/`;
    await until('nginx', () =>
      fetch(url).then(
        ({ ok }) => ok,
        () => false,
      ),
    );
    const page = await newPage(stage, PHONE);
    await page.open(url);
    await isRecorded(page);
    const first = await shown(page);
    expect(first.offMs).toBeLessThan(NEAR_MS);
    await page.press('Space');
    await until('it plays', async () => (await shown(page)).seq > first.seq + 10);
    await page.open(`${url}embed/`);
    await isRecorded(page);
  },
  240_000,
);

it('parts that are missing, cut or swapped are gaps that the page counts', async () => {
  const lecture = shared.copy(stage.stack);
  const at = (n: number) => path.join(lecture.at, lecture.segments[n]!);
  expect(lecture.segments.length).toBeGreaterThan(5); // the last one stays: the end shows a pose
  rmSync(at(1));
  writeFileSync(at(2), readFileSync(at(2)).subarray(0, 500));
  renameSync(at(4), `${at(4)}.x`);
  writeFileSync(at(4), readFileSync(at(0)));
  const host = await Host.open(lecture.at, PREFIX);
  try {
    const page = await newPage(stage);
    page.forgive(/404/);
    await page.open(`${host.url}${PREFIX}`);
    await isRecorded(page);
    const [fresh, grey] = await numberColors(page);
    expect(fresh).not.toBe(grey);
    const { segments } = JSON.parse(readFileSync(path.join(lecture.at, 'recording.json'), 'utf8'));
    const lostMs = lecture.fromMs + segments[2][2] + 500;
    await page.evaluate(`location.hash = '#/?t=${new Date(lostMs).toISOString()}'`);
    await until('a lost part', async () => /part .* is missing/.test(await textOf(page, 'stage-note')));
    await until('its numbers grey with the body', async () => (await numberColors(page))[0] === grey);
    await page.screenshot('recording-gap.png');
    await page.evaluate(`location.hash = '#/?t=${new Date(lecture.fromMs).toISOString()}'`);
    await until('its first pose', async () => (await numberColors(page))[0] === fresh);
    await page.press(']');
    await page.press(']');
    await page.press('Space');
    await until('its end', atEnd(page, lecture));
    expect(await textOf(page, 'recording-lost')).toBe(
      `3 of ${lecture.segments.length} parts are missing or damaged.`,
    );
    await page.screenshot('recording-lost.png');
  } finally {
    await host.close();
  }
}, 240_000);

it('with its host gone it plays what it has, says so, and goes on when the host is back', async () => {
  const lecture = shared.copy(stage.stack);
  let host = await Host.open(lecture.at, PREFIX);
  const { port } = host;
  try {
    const page = await newPage(stage);
    page.forgive(/ERR_|Failed to (load|fetch)|NetworkError|CORS|access control|load failed/i);
    await page.open(`${host.url}${PREFIX}`);
    await isRecorded(page);
    const first = await shown(page);
    await page.press('Space');
    await until('it plays', async () => (await shown(page)).seq > first.seq + 5);
    await host.close();
    await until('it says so', async () => /does not answer/.test(await textOf(page, 'past-note')));
    const held = (await shown(page)).seq;
    expect(await liveness(page)).toBe('RECORDED');
    host = await Host.open(lecture.at, PREFIX, port);
    await until('it goes on', async () => (await shown(page)).seq > held + 60);
    await until('its end', atEnd(page, lecture));
    expect(await page.findByTestId('recording-lost').count()).toBe(0);
  } finally {
    await host.close();
  }
}, 240_000);

it('in a frame of another page it has its chip, a button that plays it and a slim line', async () => {
  const lecture = shared.copy(stage.stack);
  const host = await Host.open(lecture.at, PREFIX);
  const course = stage.stack.folder();
  writeFileSync(
    path.join(course, 'index.html'),
    `<!doctype html><title>Course</title><link rel="icon" href="data:,">
     <script>window.told = []; addEventListener('message', ({ data }) => window.told.push(data));</script>
     <iframe src="${host.url}${PREFIX}embed/index.html?origin=ORIGIN" title="Lecture" width="640" height="400"></iframe>`,
  );
  const around = await Host.open(course);
  const page = await newPage(stage, { width: 700, height: 480 });
  page.allow(new URL(host.url).host);
  page.allow(new URL(around.url).host);
  try {
    around.instead.set(
      '/index.html',
      readFileSync(path.join(course, 'index.html'), 'utf8').replace('ORIGIN', around.url),
    );
    await page.open(`${around.url}/`);
    await until(
      'it tells its page',
      holds(page, `window.told.some(({ word, moment_ms }) => word === 'RECORDED' && moment_ms > 0)`),
    );
    await page.screenshot('recording-framed.png');
    // the frame alone: the driver can't look into another origin
    await page.open(`${host.url}${PREFIX}embed/index.html`);
    await isRecorded(page);
    expect(await page.findByTestId('transport').count()).toBe(0);
    expect(await page.findByTestId('note-mark').count()).toBe(0);
    expect(await textOf(page, 'note-caption')).toBe('');
    await page.open('about:blank');
    const noted = new Date(lecture.fromMs + 4000 + 50).toISOString();
    await page.open(`${host.url}${PREFIX}embed/index.html#/?t=${noted}`);
    await isRecorded(page);
    await until('the note', async () => (await textOf(page, 'note-caption')) === TOLD.notes[1][1]);
    expect(await page.evaluate<number>(`${testId('note-caption')}.clientHeight`)).toBeLessThan(60);
    await page.screenshot('recording-framed-note.png');
    const first = await shown(page);
    await page.findByTestId('play').click();
    await until('it plays', async () => (await shown(page)).seq > first.seq + 10);
    expect(await chipText(page)).toMatch(/^RECORDED/);
  } finally {
    await host.close();
    await around.close();
  }
}, 240_000);
