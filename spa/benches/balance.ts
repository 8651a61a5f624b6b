import { parseSchema } from '@posecast/wire';
import { BalanceReader, FrameBody } from '../src/model/balance/balance_reader.ts';
import { readManifest } from '../src/model/manifest.ts';
import { Footprints } from '../src/scene/signs/footprints.ts';

const JOINTS = 60;
const FRAMES = 2000;
const ROUNDS = 7;

/** Ten chains of six joints below a trunk; two of them end in feet with wrenches. */
function makeManifest(): Record<string, unknown> {
  const joints = Array.from({ length: JOINTS }, (_, i) => ({
    ...{ name: `j${i}`, type: 'revolute', parent: i % 6 === 0 ? 0 : i, child: i + 1 },
    ...{
      xyz: [0.01 * (i % 5), 0.02 * (i % 3), -0.1],
      axis: [
        [1, 0, 0],
        [0, 1, 0],
        [0, 0, 1],
      ][i % 3],
    },
  }));
  const links = ['trunk', ...joints.map(({ name }) => `l${name}`)];
  const corners = Array.from({ length: 16 }, (_, i) => [
    0.1 * Math.cos((i * Math.PI) / 8),
    0.05 * Math.sin((i * Math.PI) / 8),
    -0.03,
  ]);
  return {
    ...{ v: 2, robot: 'r', files: [], levels: [], links, joints },
    visuals: links.map((_, link) => ({
      link,
      source: '',
      box: [
        [-0.1, -0.1, -0.1],
        [0.1, 0.1, 0.1],
      ],
    })),
    inertials: links.map((_, link) => ({
      link,
      mass_kg: 1,
      xyz: [0, 0, -0.05],
      inertia: [1, 0, 0, 1, 0, 1],
    })),
    soles: [6, 12].map((link) => ({ link, points: corners })),
  };
}

function makeSchema(): string {
  const sites = ['RF', 'LF'];
  const mount = (link: string) => ({ kind: 'wrench', name: link, link });
  const labels = {
    joint: Array.from({ length: JOINTS }, (_, i) => `j${i}`),
    ftf: sites.flatMap((site) => ['fx', 'fy', 'fz'].map((part) => `${site}.${part}`)),
    ftm: sites.flatMap((site) => ['mx', 'my', 'mz'].map((part) => `${site}.${part}`)),
    quat: ['w', 'x', 'y', 'z'].map((part) => `imu.${part}`),
  };
  const fields = Object.keys(labels).map((name) => ({
    name: name === 'joint' ? 'pos' : name,
    labels: name,
    scale: 0.001,
  }));
  const sensors = { RF: mount('lj5'), LF: mount('lj11'), imu: { kind: 'imu', name: 'imu', link: 'trunk' } };
  return JSON.stringify({ type: 'schema', v: 1, robot: 'r', labels, fields, mapping: { sensors } });
}

/** µs per frame: the median of the rounds, the minimum and the maximum. */
function timed(work: (frame: number) => void): string {
  const rounds = Array.from({ length: ROUNDS + 2 }, () => {
    const from = performance.now();
    for (let frame = 0; frame < FRAMES; frame += 1) work(frame);
    return ((performance.now() - from) * 1000) / FRAMES;
  })
    .slice(2) // warm-up: the first rounds trigger compilation
    .sort((a, b) => a - b);
  const told = [rounds[Math.floor(ROUNDS / 2)]!, rounds[0]!, rounds.at(-1)!].map((us) => us.toFixed(1));
  return `${told[0]} µs (${told[1]}–${told[2]})`;
}

/** Lines to print. */
export function measureBalance(): string[] {
  const manifest = readManifest(makeManifest());
  const schema = parseSchema(makeSchema());
  const frames = Array.from({ length: 100 }, (_, i) => {
    const codes = Int32Array.from({ length: schema.size }, (_, at) =>
      Math.round(300 * Math.sin(at + i / 10)),
    );
    for (const [at, label] of schema.field('ftf')!.labels.entries())
      if (label.endsWith('fz')) codes[schema.field('ftf')!.start + at] = 300_000;
    return codes;
  });
  const codesOf = (frame: number) => frames[frame % frames.length]!;
  let tS = 0;
  const next = () => (tS += 0.02);
  const body = new FrameBody(manifest, schema);
  const [byFrame, byBody] = [new BalanceReader(manifest, schema), new BalanceReader(manifest, schema)];
  const places = new Map(
    manifest.links.map((link, i) => [link, { elements: body.worldFromLink.subarray(16 * i, 16 * i + 16) }]),
  );
  const linked = { linkMatrix: (name: string) => places.get(name) };
  const left = new Footprints();
  return [
    `a frame of ${JOINTS} joints, ${FRAMES} of them, median of ${ROUNDS} rounds (least–most), Node ${process.version}`,
    `kinematics alone:                  ${timed((i) => body.follow(codesOf(i)))}`,
    `balance of a frame, with them:     ${timed((i) => byFrame.ofFrame(codesOf(i), next()))}`,
    `balance of a body that is shown:   ${timed((i) => byBody.ofBody(linked, byBody.wrenches(codesOf(i)), next()))}`,
    `the same, with trace and footprints: ${timed((i) => {
      const t = next();
      left.take(byBody.ofBody(linked, byBody.wrenches(codesOf(i)), t), t, false, 1);
    })}`,
  ];
}
