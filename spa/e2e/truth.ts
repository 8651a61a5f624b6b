/** Whether a page tells the truth: compares what its chip claims with the robot's pose at that time. */

import { writeFileSync } from 'node:fs';
import path from 'node:path';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import type { Process } from './process.ts';
import type { Relay, Sample, Stack } from './stack.ts';

/** Two joints are the hand of a clock, so a pose reveals its time: one revolution takes this long, by the machine's clock. */
const ROUND_S = 60;
const REACH_RAD = 3;
const HANDS: Sample = {
  pos: { RKN: 0, LKN: 0 },
  wave: { pos: { RKN: [REACH_RAD, 1 / ROUND_S, 0], LKN: [REACH_RAD, 1 / ROUND_S, Math.PI / 2] } },
};
/** A pose in motion between two places is off the circle. */
const OFF_THE_CIRCLE = 0.03;

const STALE_AFTER_MS = 1500;
const HOLDING_AFTER_MS = 3000;
/** Time from the joint to the screen, played and rendered in software on a busy machine. */
const ON_ITS_WAY_MS = 1000;
const ROUNDING_MS = 100;
/** What is shown for less than this is nobody's claim. */
const GLANCE_MS = 250;
/** Maximum time between pictures; if the machine takes longer, the page is not to blame for that long. */
const PICTURE_MS = 100;
const CATCHING_UP_MS = 5000;
/** The delay is shown in whole seconds, and changes only when it is off by more. */
const BEHIND_ROUNDING_MS = 1250;
/** The first pose of a segment is shown for a moment until the segment has loaded. */
const A_SEGMENT_MS = 6000 + ON_ITS_WAY_MS;

const joint = (name: string) => `
  <link name="${name}"><visual><geometry><box size="0.1 0.1 0.5"/></geometry></visual></link>
  <joint name="${name}" type="continuous">
    <parent link="post"/><child link="${name}"/><axis xyz="0 0 1"/>
  </joint>`;
const URDF = `<robot name="clock">
  <link name="post"><visual><geometry><box size="0.2 0.2 0.2"/></geometry></visual></link>
  ${joint('RKN')}${joint('LKN')}
</robot>`;

/** What was visible after a picture: the chip's word, the two joints in the body and in the table, the moment of the past, and
 *  the delay in seconds according to the chip. */
type Seen = readonly [atMs: number, word: string, ...joints: (number | null)[]];

/** Runs before the page's own scripts: records what is visible after each picture. */
export const WITNESS = `(() => {
  const seen = (window.witnessed = []);
  const angle = (matrix) => (matrix ? Math.atan2(matrix[4], matrix[0]) : null);
  const cell = (label) => {
    const text = document.querySelector('td[data-field="pos"][data-label="' + label + '"]')?.textContent;
    const number = text?.replace('\\u2212', '-').match(/-?\\d+(\\.\\d+)?/);
    return number ? Number(number[0]) : null;
  };
  const note = (pictureMs) => {
    if (Date.now() - pictureMs > 1000) return; // this program was stopped in between: the picture no longer shows the present
    const links = window.posecast?.scene?.linkPoses?.() ?? {};
    const word = document.querySelector('[data-testid="liveness"]')?.dataset.state ?? '';
    const behind = document.querySelector('[data-testid="behind"]')?.textContent.match(/^\\d+(?= ?[s초])/);
    seen.push([
      Date.now(), word, angle(links.RKN), angle(links.LKN), cell('RKN'), cell('LKN'),
      window.posecast?.twin?.moment_ms ?? null, behind ? Number(behind[0]) : null,
    ]);
  };
  const look = () => {
    setTimeout(note, 0, Date.now()); // after everything that this picture changes has changed
    requestAnimationFrame(look);
  };
  look();
})()`;

/** A robot whose pose encodes the time, and the times at which it stood still. */
export class ClockRobot {
  readonly source: Process;
  readonly edge: Process;
  readonly #stands: { fromMs: number; toMs: number }[] = [];

  constructor(stack: Stack, relay: Relay, robot = 'demo') {
    const urdf = path.join(stack.folder(), 'clock.urdf');
    writeFileSync(urdf, URDF);
    ({ source: this.source, edge: this.edge } = stack.fedEdge(relay, HANDS, { urdf, robot }));
  }

  /** Stops its hand at its current place. */
  stand(): void {
    const fromMs = Date.now();
    this.#stands.push({ fromMs, toMs: Number.POSITIVE_INFINITY });
    this.source.write(JSON.stringify({ ...HANDS, still_at: fromMs / 1000 }));
  }

  /** Lets its hand jump to the present and continue. */
  go(): void {
    this.#stands.at(-1)!.toMs = Date.now();
    this.source.write(JSON.stringify(HANDS));
  }

  /** The page's false claims: each kind once, with the oldest pose. A claim counts once it has been shown for `GLANCE_MS`: React
   *  draws the chip and the render loop the body, so on a busy machine one may be a picture or two ahead of the other. */
  async lies(page: Page): Promise<string[]> {
    const seen = await page.evaluate<Seen[]>('window.witnessed');
    const worst = new Map<string, number>();
    /** Since when the newest picture's lies have been shown, ms. */
    let shownNow = new Map<string, number>();
    let otherwiseMs = Number.NEGATIVE_INFINITY;
    let before = '';
    const heldUp = new HeldUp();
    for (const [atMs, word, ...joints] of seen) {
      heldUp.look(atMs);
      const shownBefore = shownNow;
      const tell = (what: string, oldMs: number) => {
        const sinceMs = shownBefore.get(what) ?? atMs;
        shownNow.set(what, sinceMs);
        if (atMs - sinceMs >= GLANCE_MS) worst.set(what, Math.max(oldMs, worst.get(what) ?? oldMs));
      };
      shownNow = new Map();
      if (!isClaim(word) && word !== '' && isClaim(before)) otherwiseMs = atMs;
      before = word;
      const momentMs = joints[4] ?? null;
      if (isThen(word) || momentMs !== null) {
        const offMs = offPast(word, momentMs, toldMs(joints[0] ?? null, joints[1] ?? null, momentMs ?? atMs));
        if (offMs > heldUp.ms + A_SEGMENT_MS) tell(`body: ${word} of another moment`, offMs);
        continue;
      }
      if (!isClaim(word)) continue;
      const behindMs = 1000 * (joints[5] ?? 0);
      for (const [where, sine, cosine] of [
        ['body', joints[0], joints[1]],
        ['table', joints[2], joints[3]],
      ] as const) {
        const lie = this.#lie(
          atMs,
          word,
          otherwiseMs,
          toldMs(sine ?? null, cosine ?? null, atMs),
          heldUp.ms,
          behindMs,
        );
        if (lie === null) continue;
        const what = `${where}: ${word} ${lie[0]}`;
        tell(what, lie[1]);
      }
    }
    return [...worst].map(([what, oldMs]) => `${what}, ${(oldMs / 1000).toFixed(1)} s`);
  }

  /** Whether it had stood still long enough to be called HOLDING, as far as is known by now. */
  #stood(atMs: number, withinMs: number, heldUpMs: number): boolean {
    return this.#stands.some(
      ({ fromMs, toMs }) =>
        atMs - fromMs > HOLDING_AFTER_MS - ROUNDING_MS - withinMs &&
        atMs < toMs + STALE_AFTER_MS + ON_ITS_WAY_MS + withinMs + heldUpMs,
    );
  }

  #lie(
    atMs: number,
    word: string,
    otherwiseMs: number,
    poseMs: number | null,
    heldUpMs: number,
    behindMs: number,
  ): [string, number] | null {
    if (poseMs === null) return null; // not there yet, or between two poses
    const roundingMs = behindMs === 0 ? 0 : BEHIND_ROUNDING_MS;
    const stand = this.#stands.find(({ fromMs }) => Math.abs(fromMs - poseMs) < ROUNDING_MS);
    const between = this.#stands.some(({ fromMs, toMs }) => poseMs > fromMs && poseMs < toMs);
    if (between && stand === undefined) return null; // it never was there: in motion from where it stood
    const trueUntilMs = stand?.toMs ?? poseMs;
    const oldMs = atMs - trueUntilMs;
    if (oldMs > behindMs + roundingMs + STALE_AFTER_MS + ON_ITS_WAY_MS + heldUpMs)
      return ['with an old pose', oldMs];
    if (trueUntilMs + behindMs + roundingMs < otherwiseMs - ON_ITS_WAY_MS - heldUpMs)
      return ['again with a pose from before', oldMs];
    if (word === 'HOLDING' && !this.#stood(atMs - behindMs, roundingMs, heldUpMs))
      return ['while it moved', oldMs];
    return null;
  }
}

/** How long the page's machine has recently prevented it from showing anything. */
class HeldUp {
  #gaps: [atMs: number, longMs: number][] = [];
  #lastMs = Number.POSITIVE_INFINITY;

  look(atMs: number): void {
    const longMs = atMs - this.#lastMs - PICTURE_MS;
    this.#lastMs = atMs;
    if (longMs > 0) this.#gaps.push([atMs, longMs]);
    this.#gaps = this.#gaps.filter(([endMs]) => atMs - endMs < CATCHING_UP_MS);
  }

  get ms(): number {
    return this.#gaps.reduce((sum, [, longMs]) => sum + longMs, 0);
  }
}

function isClaim(word: string): boolean {
  return word === 'LIVE' || word === 'HOLDING';
}

function isThen(word: string): boolean {
  return word === 'PAST' || word === 'RECORDED';
}

/** The difference between the pose and its claimed moment; infinite if it is called neither PAST nor RECORDED. */
function offPast(word: string, momentMs: number | null, poseMs: number | null): number {
  if (!isThen(word)) return Number.POSITIVE_INFINITY;
  return poseMs === null || momentMs === null ? 0 : Math.abs(poseMs - momentMs);
}

/** When the hand was there: of all revolutions, the time nearest to now. */
function toldMs(sine: number | null, cosine: number | null, nowMs: number): number | null {
  if (sine === null || cosine === null) return null;
  if (Math.abs(Math.hypot(sine, cosine) / REACH_RAD - 1) > OFF_THE_CIRCLE) return null;
  const roundMs = ROUND_S * 1000;
  const withinMs = (Math.atan2(sine, cosine) / (2 * Math.PI)) * roundMs;
  return withinMs + roundMs * Math.round((nowMs - withinMs) / roundMs);
}

/** A page's display of a past `ClockRobot`. */
interface Shown {
  readonly seq: number;
  readonly momentMs: number | null;
  /** The difference between the robot's hands and that moment, ms. */
  readonly offMs: number;
}

/** A page's current display of a `ClockRobot`. */
export function shown(page: Page): Promise<Shown> {
  return page.evaluate<Shown>(`(() => {
    const { twin, scene } = window.posecast;
    const { RKN, LKN } = scene.linkPoses();
    const angle = (matrix) => Math.atan2(matrix[4], matrix[0]);
    const turn = Math.atan2(angle(RKN), angle(LKN)) / (2 * Math.PI);
    const off = Math.abs((twin.moment_ms % ${ROUND_S * 1000}) - ((turn + 1) % 1) * ${ROUND_S * 1000});
    return { seq: twin.seq, momentMs: twin.moment_ms, offMs: Math.min(off, ${ROUND_S * 1000} - off) };
  })()`);
}

/** Steps frame by frame, also back, to a frame that has its millisecond for itself: a link to it names no other one. A busy machine
 *  receives several at once. */
export async function stepToFrame(page: Page): Promise<Shown> {
  const step = async (key: '.' | ',', seq: number) => {
    await page.press(key);
    await until(`frame ${seq}`, async () => (await shown(page)).seq === seq);
    return shown(page);
  };
  return until('a frame apart from the next', async () => {
    const { seq } = await shown(page);
    const one = await step('.', seq + 1);
    const two = await step('.', seq + 2);
    await step(',', seq + 1);
    return two.momentMs! - one.momentMs! > 1 ? one : null;
  });
}

/** The age of the body's pose while it was LIVE, ms: median and a high percentile of all pictures. */
export async function ageOfLive(page: Page): Promise<{ p50: number; p99: number }> {
  const seen = await page.evaluate<Seen[]>('window.witnessed');
  const ages = seen
    .flatMap(([atMs, word, sine, cosine]) => {
      const poseMs = toldMs(sine ?? null, cosine ?? null, atMs);
      return word === 'LIVE' && poseMs !== null ? [atMs - poseMs] : [];
    })
    .sort((a, b) => a - b);
  const part = (of: number) => Math.round(ages[Math.floor(of * ages.length)] ?? Number.NaN);
  return { p50: part(0.5), p99: part(0.99) };
}
