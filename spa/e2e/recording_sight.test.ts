import { expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { exportPast } from './exported.ts';
import { Host } from './host.ts';
import { FaultyLink } from './proxy.ts';
import { liveness } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** 1.6 Mbit/s for all connections together, and a round trip of 150 ms, including the handshake of a new connection. */
const SLOW = { delayMs: 75, bytesPerSecond: 200_000 };

interface Sight {
  readonly marks: Readonly<Record<string, number>>;
  readonly asked: readonly {
    readonly file: string;
    readonly startMs: number;
    readonly endMs: number;
    readonly bytes: number;
  }[];
  readonly fcpMs: number;
}

const SIGHT = `(() => ({
  marks: Object.fromEntries(performance.getEntriesByType('mark').map((e) => [e.name.replace('posecast:', ''), e.startTime])),
  asked: performance.getEntriesByType('resource').map((e) => ({
    file: e.name.split('/').pop().replace(/-[\\w-]{8}\\.(js|css)$/, '.$1'), startMs: e.startTime, endMs: e.responseEnd, bytes: e.transferSize,
  })),
  fcpMs: performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN,
}))()`;

it('a recording on a slow line moves nothing before its first pose that it does not need', async () => {
  const relay = await stage.stack.relay({ past: 'memory:' });
  stage.stack.edge(relay);
  const lecture = await exportPast(stage.stack, relay, 20, { title: 'Balance' });
  await relay.process.kill();
  const host = await Host.open(lecture.at);
  host.packs = true;
  const link = await FaultyLink.open(host.port);
  link.fault(SLOW);
  try {
    const page = await stage.newPage({ viewport: { width: 390, height: 844 } });
    await page.open(`${link.url}/`);
    const look = () => page.evaluate<Sight>(SIGHT);
    for (const mark of ['skeleton', 'skin'])
      await until(mark, async () => (await look()).marks[mark] !== undefined, 60_000);
    expect(await liveness(page)).toBe('RECORDED');
    const { marks, asked, fcpMs } = await look();
    for (const { file, startMs, endMs, bytes } of asked)
      console.log(
        `${startMs.toFixed(0).padStart(6)} – ${endMs.toFixed(0).padStart(6)} ms ${bytes} B ${file}`,
      );
    console.log(
      `a recording: script has run after ${marks.script?.toFixed(0)} ms, first pose (lines) after ${marks.skeleton?.toFixed(0)} ms, shells after ${marks.skin?.toFixed(0)} ms, first paint ${fcpMs.toFixed(0)} ms`,
    );
    const firstPart = asked.find(({ file }) => file.endsWith('.segment'))!;
    // what is asked for beside the first segment comes in an order that depends on the machine
    const before = asked.filter(({ startMs }) => startMs <= firstPart.startMs);
    const own = asked.filter(({ file }) => /\.json$|\.segment$|\.glb$|\.keys$/.test(file));
    expect(
      own
        .filter(({ startMs }) => startMs < marks.skeleton!)
        .map(({ file }) => file)
        .sort(),
    ).toEqual(['0.segment', 'low.glb', 'manifest.json', 'recording.json']);
    expect(before.map(({ file }) => file)).toEqual(
      expect.arrayContaining(['recording.json', 'manifest.json']),
    );
    // the delay between bytes and picture depends on the machine
    const needed = before.filter(({ file }) => !/^(three|articulated|imus|favicon)|\.glb$/.test(file));
    expect(needed.reduce((sum, { bytes }) => sum + bytes, 0)).toBeLessThan(223_000);
  } finally {
    await link.close();
    await host.close();
  }
}, 180_000);
