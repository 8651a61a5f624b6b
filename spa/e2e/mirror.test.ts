import { cpSync } from 'node:fs';
import path from 'node:path';
import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { Host } from './host.ts';
import type { Process } from './process.ts';
import { chipText, is, RECORD, SWINGING, shownSeq } from './robot_page.ts';
import { PYTHON, REPO } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

/** `tests/rtdb_double.py`, not Google's. */
async function database(): Promise<{ url: string; becomes(fault: object): Promise<unknown> }> {
  const rules = path.join(REPO, 'infra/firebase/database.rules.json');
  const double = stage.stack.start('database', PYTHON, [path.join(REPO, 'tests/rtdb_double.py'), rules]);
  const [url] = await double.line(/http:\/\/127\.0\.0\.1:\d+/);
  return {
    url,
    becomes: (fault) => fetch(`${url}/.double`, { method: 'POST', body: JSON.stringify(fault) }),
  };
}

interface Mirrored {
  readonly page: Page;
  readonly source: Process;
  readonly edge: Process;
  readonly relay: Process;
  readonly db: Awaited<ReturnType<typeof database>>;
}

/** A page on a static file host, with a mirror written by the relay. */
async function mirrored(then: (at: Mirrored) => Promise<void>): Promise<void> {
  const db = await database();
  const relay = await stage.stack.relay({ mirror: db.url });
  const { source, edge } = stage.stack.fedEdge(relay, SWINGING);
  const folder = stage.stack.folder();
  cpSync(path.join(REPO, 'spa/dist'), folder, { recursive: true });
  const host = await Host.open(folder);
  try {
    host.instead.set('/config.json', JSON.stringify({ relay: relay.url, firebase: { databaseURL: db.url } }));
    const page = await stage.newPage({ preload: RECORD });
    page.allow(new URL(relay.url).host);
    page.allow(new URL(db.url).host);
    await page.open(`${host.url}/?source=firebase#/r/demo`);
    await until('LIVE', is(page, 'LIVE'));
    await then({ page, source, edge, relay: relay.process, db });
  } finally {
    await host.close();
  }
}

const cause = (page: Page) =>
  page.evaluate<string>(`document.querySelector('[data-testid="liveness"]')?.dataset.cause ?? ''`);

it('is read from the database alone, twice a second, and the page says so', async () => {
  await mirrored(async ({ page, source, relay, db }) => {
    const seen = (await shownSeq(page)) ?? 0;
    await until('poses go on', async () => ((await shownSeq(page)) ?? 0) > seen + 60);
    expect(
      page.requested.filter((url) => /\/live/.test(url)),
      'no stream of the relay',
    ).toEqual([]);
    expect(page.requested.filter((url) => url === `${db.url}/posecast/demo.json`).length).toBe(1);
    expect(await chipText(page)).toMatch(/mirror/);
    await page.findByTestId('liveness').click();
    await until('explained', async () => (await page.findByTestId('liveness-explained').text()) !== '');
    expect(await page.findByTestId('liveness-explained').text()).toMatch(/reads a mirror.*2 poses a second/s);
    const elsewhere = await page.evaluate<string>(
      `fetch('http://127.0.0.1:9/').then(() => 'came', () => 'refused')`,
    );
    expect(elsewhere).toBe('refused');
    page.forgive(/Content.Security.Policy|Refused to connect|held back by policy/); // the message differs by browser

    source.signal('SIGSTOP');
    await until(
      'robot silent',
      async () => (await is(page, 'STALE')()) && (await cause(page)) === 'robot silent',
    );
    source.signal('SIGCONT');
    await until('LIVE', is(page, 'LIVE'));

    await db.becomes({ cut: true });
    await db.becomes({});
    await until('another connection', async () => requests(page, db.url) > 1);
    await until('LIVE on it', is(page, 'LIVE'));

    await relay.stop();
    await until(
      'nobody writes',
      async () => (await is(page, 'STALE')()) && (await cause(page)) !== 'robot silent',
    );
    await until('and it knows', async () => (await cause(page)) === 'relay degraded');
  });
});

it.skipIf(!FULL)('a robot that leaves is offline; a mirror that is closed is asked for no more', async () => {
  await mirrored(async ({ page, edge, db }) => {
    await edge.stop();
    await until('OFFLINE', is(page, 'OFFLINE'));
    await db.becomes({ cancel: true });
    await until('not shared', async () => /not shared with you/.test(await page.text()));
  });
});

function requests(page: Page, database: string): number {
  return page.requested.filter((url) => url === `${database}/posecast/demo.json`).length;
}
