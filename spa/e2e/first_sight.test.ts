import { existsSync } from 'node:fs';
import { expect, it } from 'vitest';
import { engineName } from './driver/engines.ts';
import { until } from './driver/until.ts';
import { exportPast } from './exported.ts';
import { Host } from './host.ts';
import { FaultyLink } from './proxy.ts';
import { canBuild, SHARED_ROBOTS } from './shared_robots.ts';
import type { Relay } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

/** What may come before the skeleton: what it takes, and two percent. On this machine's own address, Chromium asks for Brotli even
 *  without TLS; the others don't. */
const FIRST_BYTES = engineName() === 'chromium' ? 121_000 : 143_000;

/** 1.6 Mbit/s for all connections together, and a round trip of 150 ms, including the handshake of a new connection. */
const SLOW = { delayMs: 75, bytesPerSecond: 200_000 };

const LAPTOP = { width: 1280, height: 800 };

interface Asked {
  readonly file: string;
  readonly startMs: number;
  readonly endMs: number;
  readonly bytes: number;
}

/** As the relay lists a robot. */
interface Listed {
  readonly status: string;
  readonly model: string | null;
}

interface Sight {
  /** When the page's script had run (after what it imports), and each later step, ms. */
  readonly marks: Readonly<Record<string, number>>;
  readonly asked: readonly Asked[];
}

const SIGHT = `(() => ({
  marks: Object.fromEntries(performance.getEntriesByType('mark').map((e) => [e.name.replace('posecast:', ''), e.startTime])),
  asked: performance.getEntriesByType('resource').map((e) => ({
    file: e.name.split('/').pop().replace(/-[\\w-]{8}\\.(js|css)$/, '.$1'), startMs: e.startTime, endMs: e.responseEnd, bytes: e.transferSize,
  })),
}))()`;

/** What a page on a slow connection to this port has seen once it shows a robot's meshes. */
async function sightOf(port: number, address: string, viewport = LAPTOP): Promise<Sight> {
  const link = await FaultyLink.open(port);
  link.fault(SLOW);
  try {
    const page = await stage.open(`${link.url}/${address}`, { viewport });
    const look = () => page.evaluate<Sight>(SIGHT);
    for (const mark of ['skeleton', 'skin'])
      await until(mark, async () => (await look()).marks[mark] !== undefined);
    const seen = await look();
    const ms = (value = Number.NaN) => `${value.toFixed(0).padStart(6)} ms`;
    for (const { file, startMs, endMs, bytes } of seen.asked)
      console.log(`${ms(startMs)} – ${ms(endMs)} ${bytes} B ${file}`);
    const { script, skeleton, skin } = seen.marks;
    console.log(
      `${address}: script ${ms(script)}, skeleton ${ms(skeleton)}, shells ${ms(skin)}; ${link.passedBytes} bytes in all`,
    );
    return seen;
  } finally {
    await link.close();
  }
}

async function firstSight(relay: Relay, robot: string): Promise<Sight> {
  await until('on air, with a model', async () => {
    const [found] = ((await relay.json('/api/v1/robots')) as { robots: Listed[] }).robots;
    return found?.status === 'online' && found.model !== null;
  });
  return sightOf(relay.port, `#/r/${robot}`);
}

/** Nothing waits for anything it does not need: checks order and bytes, regardless of the machine's load. */
function nothingInTheWay({ marks, asked }: Sight, manifestBytes: number): void {
  const file = (name: string): Asked => {
    const found = asked.find((one) => one.file === name);
    if (found === undefined) throw new Error(`${name} was never asked for: ${asked.map((one) => one.file)}`);
    return found;
  };
  const at = (mark: string): number => marks[mark] ?? Number.NaN;

  // What the skeleton waits for, and nothing else: page, styles, stream, and finally the manifest. What the page's script asks for
  // comes beside the manifest, in an order that depends on the machine; shells may already be on their way.
  const before = asked.filter((one) => one.startMs < at('script') && !/^favicon|\.glb$/.test(one.file));
  const needed = [...new Set([...before, file('manifest.json')])];
  expect(needed.map((one) => one.file)).toEqual(
    expect.arrayContaining(['early.js', 'index.css', 'index.js', 'manifest.json', 'worker.js']),
  );
  expect(needed.reduce((sum, one) => sum + one.bytes, 0)).toBeLessThan(FIRST_BYTES);
  // Page → early script → worker → hello on the stream → manifest: nothing else waits for anything before it.
  expect(file('early.js').startMs).toBeLessThan(file('index.js').endMs);
  expect(file('worker.js').startMs, 'the stream starts before the page is here').toBeLessThan(at('script'));
  expect(file('manifest.json').bytes, 'packed').toBeLessThan(manifestBytes);
  // The delay between bytes and picture depends on the machine; nothing large may come before it.
  expect(at('skeleton'), 'lines before 3D is set up').toBeLessThan(at('scene'));
  expect(
    asked.find((one) => one.file.endsWith('.glb'))?.startMs,
    'shells side by side with the code for them',
  ).toBeLessThan(at('scene'));
  expect(at('skin'), 'shells after lines').toBeGreaterThan(at('skeleton'));
}

it('on a slow line the robot moves in lines at once, and has its shells when their bytes are here', async () => {
  const relay = await stage.stack.demo(); // the demo robot
  nothingInTheWay(await firstSight(relay, 'demo'), 6000);
});

const G1 = SHARED_ROBOTS.g1 ?? '';
it.skipIf(!FULL || !existsSync(G1) || !canBuild())(
  'so does Unitree G1, whose model the edge has built',
  async () => {
    const relay = await stage.stack.relay();
    const swinging = {
      pos: { left_knee_joint: 0.4, right_knee_joint: 0.4 },
      wave: { pos: { left_elbow_joint: [0.6, 0.5] } },
    };
    stage.stack.fedEdge(relay, swinging, { robot: 'g1', urdf: G1 });
    const seen = await firstSight(relay, 'g1');
    nothingInTheWay(seen, 12_000);
    const shells = seen.asked.filter(
      (one) => one.file.endsWith('.glb') && one.endMs <= (seen.marks.skin ?? 0),
    );
    expect(shells.length, 'its lowest level, and no other').toBe(1);
    expect(shells[0]?.bytes).toBeLessThan(200_000);
  },
  120_000,
);

it('a recording on a slow line moves nothing before its first pose that it does not need', async () => {
  const relay = await stage.stack.demo({ past: 'memory:' });
  const lecture = await exportPast(stage.stack, relay, 8, { title: 'Balance' });
  await relay.process.kill();
  const host = await Host.open(lecture.at);
  host.packs = true;
  try {
    const { marks, asked } = await sightOf(host.port, '', { width: 390, height: 844 });
    const firstPart = asked.find(({ file }) => file.endsWith('.segment'))!;
    // what is asked for beside the first segment comes in an order that depends on the machine
    const before = asked.filter(({ startMs }) => startMs <= firstPart.startMs);
    const own = asked.filter(({ file }) => /\.json$|\.segment$|\.glb$|\.keys$/.test(file));
    const early = own.filter(({ startMs }) => startMs < marks.skeleton!).map(({ file }) => file);
    // shells may already be on their way
    expect(early.filter((file) => file !== 'low.glb').sort()).toEqual([
      '0.segment',
      'manifest.json',
      'recording.json',
    ]);
    expect(before.map(({ file }) => file)).toEqual(
      expect.arrayContaining(['recording.json', 'manifest.json']),
    );
    // the delay between bytes and picture depends on the machine
    const needed = before.filter(
      ({ file }) => !/^(three|twin|stance|numbers_three|favicon)|\.glb$/.test(file),
    );
    expect(needed.reduce((sum, { bytes }) => sum + bytes, 0)).toBeLessThan(223_000);
  } finally {
    await host.close();
  }
}, 180_000);
