import { beforeAll, describe, expect, it, vi } from 'vitest';
import { type BalanceWatch, balanceOf } from '../../src/app/balance/balance_watch.ts';
import { forgetOwnAlarms, ownAlarms } from '../../src/app/state/own_alarms.ts';
import type { RobotLink } from '../../src/app/state/robot_link.ts';
import { changeSettings } from '../../src/app/state/settings.ts';
import { BalanceReader, FrameBody } from '../../src/model/balance/balance_reader.ts';
import type { PosedBody } from '../../src/model/posed_body.ts';
import { BalanceDrawing, type ShownBalance } from '../../src/scene/signs/balance_drawing.ts';
import { Facets } from '../../src/scene/signs/strokes.ts';
import { withEdit } from '../../src/twin/limits.ts';

import { Player } from '../../src/twin/playback/player.ts';
import { type RobotState, RobotTwin } from '../../src/twin/robot.ts';
import { type BalanceCase, readBalanceCases } from '../rigs/balance_vectors.ts';
import { signPicture } from '../rigs/signs.ts';

const manifests = new Map<string, unknown>();
vi.mock('../../src/model/files.ts', () => ({ manifestAt: async (url: string) => manifests.get(url) }));

const cases = readBalanceCases();
const named = (name: string): BalanceCase => cases.find((one) => one.name.startsWith(name))!;

/** The states of a case, shifted by this time. */
function statesOf({ schema, frames }: BalanceCase, laterMs = 0): RobotState[] {
  return frames.map(({ t, codes }, seq) => {
    const atMs = t * 1000 + laterMs;
    const times = { atMs, freshMs: atMs, bornMs: atMs, changedMs: atMs };
    return { ...times, schemaId: schema.id, seq, tS: t, codes: Int32Array.from(codes) };
  });
}

/** The signs of a robot, drawn state by state, each as if at rest. */
function signsOf({ manifest, schema }: BalanceCase) {
  const [signs, facets] = [new BalanceDrawing(), new Facets()];
  const body = new FrameBody(manifest, schema);
  const matrices = manifest.links.map((_, i) => ({
    elements: body.worldFromLink.subarray(i * 16, i * 16 + 16),
  }));
  const posed = {
    manifest,
    root: { matrixWorld: matrices[0] },
    linkMatrix: (name: string) => matrices[manifest.links.indexOf(name)],
  } as unknown as PosedBody;
  return (
    state: RobotState,
    states: readonly RobotState[] | null = null,
    tS = state.tS,
  ): ShownBalance | null => {
    const player = new Player(schema);
    player.raw = true;
    player.push(state);
    body.follow(state.codes);
    const lead = states === null ? null : { states, tS };
    const readings = { schema, choice: 'on', limits: null, joints: [], anchored: false, lead } as const;
    signs.draw(signPicture(undefined, { body: posed, pose: player.pose('pos'), reach: 1 }), facets, readings);
    return signs.shown === null ? null : JSON.parse(JSON.stringify(signs.shown)); // without its functions
  };
}

let robots = 0;

async function watchOf({ manifest, schema }: BalanceCase): Promise<[RobotTwin, BalanceWatch]> {
  robots += 1;
  const twin = new RobotTwin(`rest${robots}`, 0);
  manifests.set(`/${twin.robot}`, manifest.raw);
  twin.acceptSchema(schema);
  twin.acceptModel('m');
  const watch = balanceOf({ twin, manifestUrl: () => `/${twin.robot}` } as unknown as RobotLink);
  await new Promise((resolve) => setTimeout(resolve));
  return [twin, watch];
}

beforeAll(() => changeSettings({ balance: 'on' }));

describe('the balance of a moment at which the past rests', () => {
  const moving = cases.filter(
    ({ frames }) => frames.filter(({ balance }) => balance.velocity_mps !== null).length > 2,
  );

  it.each(moving.map((one) => [one.name, one] as const))(
    '%s: is as if it had been played to',
    async (_, one) => {
      const states = statesOf(one);
      const [played, jumped] = [signsOf(one), signsOf(one)];
      const [twin, watch] = await watchOf(one);
      for (const [i, state] of states.entries()) {
        const expected = played(state);
        jumped(states.at(-1 - i)!); // from anywhere
        expect(jumped(state, states.slice(0, i))).toEqual(expected);
        expect(jumped(state, states.slice(0, i)), 'and again, with another list').toEqual(expected);
        twin.acceptState(states.at(-1 - i)!);
        twin.acceptState(state);
        twin.acceptLead(states.slice(0, i));
        const { stance, balance } = watch.known()!;
        expect(balance!.capturePoint).toEqual(expected!.capturePoint);
        expect(stance?.level ?? 'ok', 'words and picture have one level').toBe(expected!.level);
        expect(stance?.marginMm ?? null).toBe(expected!.marginM === null ? null : expected!.marginM * 1000);
      }
      expect(played(states.at(-1)!)?.capturePoint).not.toBeNull();
    },
  );

  it('has a capture point and footprints at once, which the one pose alone has not', () => {
    const one = moving.find(({ frames }) => frames.at(-1)!.balance.capture_point_m !== null)!;
    const states = statesOf(one);
    const alone = signsOf(one)(states.at(-1)!);
    expect([alone?.capturePoint, alone?.trace]).toEqual([null, 1]);
    const led = signsOf(one)(states.at(-1)!, states.slice(0, -1));
    expect(led?.capturePoint?.[0]).toBeCloseTo(one.frames.at(-1)!.balance.capture_point_m![0]!, 3);
  });

  it('waits for its own pose: what is still on its way there does not take the lead', () => {
    const one = moving[0]!;
    const states = statesOf(one);
    const [before, last] = states.slice(-2) as [RobotState, RobotState];
    const lead = states.slice(0, -1);
    const signs = signsOf(one);
    signs(before, lead, last.tS);
    const expected = signsOf(one)(last, lead);
    expect(signs(last, lead)).toEqual(expected);
  });

  it('is computed once for each rest, however often it is drawn', () => {
    const one = moving[0]!;
    const states = statesOf(one);
    const lead = states.slice(0, -1);
    const read = vi.spyOn(BalanceReader.prototype, 'ofFrame');
    const signs = signsOf(one);
    for (let i = 0; i < 5; i += 1) signs(states.at(-1)!, lead);
    expect(read).toHaveBeenCalledTimes(lead.length);
    read.mockRestore();
  });

  it('tells of a frame that comes sooner than words are renewed while it plays', async () => {
    const one = named('leans until');
    const states = statesOf(one);
    const [twin, watch] = await watchOf(one);
    const [first, second] = states as [RobotState, RobotState];
    twin.acceptState(first);
    const near = { ...second, atMs: first.atMs + 20 };
    twin.acceptState(near);
    const stale = watch.known();
    twin.acceptLead([first]);
    expect(watch.known()).not.toBe(stale);
    expect(watch.known()?.stance?.marginMm).toBeCloseTo(one.frames[1]!.balance.margin_m! * 1000, 1);
  });
});

describe('alarms of a moment at which the past rests', () => {
  it('have the crossing where it was, not at the moment that is shown', async () => {
    const one = named('leans until');
    const states = statesOf(one, 5000);
    const outside = one.frames.findIndex(({ balance }) => (balance.margin_m ?? 1) < 0);
    const last = states[outside]!;
    const later = { ...last, seq: 99, tS: last.tS + 0.2, atMs: last.atMs + 200 };
    const [twin] = await watchOf(one);
    const rest = (state: RobotState, lead: readonly RobotState[]) => {
      forgetOwnAlarms(twin);
      twin.acceptState(state);
      forgetOwnAlarms(twin, lead[0]?.atMs);
      twin.acceptLead(lead);
      return ownAlarms(twin).map(({ atMs, state: onOff }) => [atMs, onOff]);
    };
    expect(rest(later, states.slice(0, outside + 1))).toEqual([[last.atMs, 'on']]);
    expect(rest(later, states.slice(0, outside + 1)), 'once, however often one stops').toHaveLength(1);
    expect(rest(later, [last]), 'beyond it all the time: nobody knows since when').toEqual([]);
    twin.acceptEdits(withEdit(twin.edits, 'balance', 'margin', { low: 500, high: null, caution: 1 }));
    twin.acceptLead([last]);
    expect(ownAlarms(twin), 'a limit that was set at rest').toEqual([]);
  });
});
