import { useEffect, useState } from 'react';
import { apiUrl } from '../../../relay/addresses.ts';
import { request, signInNeeded } from '../../../relay/request.ts';
import { onAccountToken, tokenFor } from '../../../relay/token.ts';
import { HoldUps, judge, type Verdict } from '../../../twin/liveness.ts';
import { isolated } from '../../../twin/names.ts';

const EVERY_MS = 2000;
const LATE_MS = 6000;

/** One robot in the relay's list. */
export interface ListedRobot {
  /** Its id, as used in addresses. */
  robot: string;
  /** Its display name, or its id if it has none; safe to show. */
  name: string;
  state: 'online' | 'silent' | 'offline';
  /** Age of its newest frame by the relay's clock; null before any. */
  ageMs: number | null;
  /** How many people watch it; null if the relay does not say. */
  viewers: number | null;
  /** SHA-256 of its model's manifest, 64 hex digits; null if it has no model. */
  model: string | null;
}

/** The list of robots. `waiting`: the relay has not answered yet; `unreachable`: the last request failed, and `robots` come from
 *  the previous answer, if any. `publishAt`: the endpoint, such as `tcp/127.0.0.1:7447`, where programs on the relay's computer
 *  may publish without a credential; null if none. `tookMs`: how long the newest answer took. */
export type RobotListing =
  | { phase: 'waiting' }
  | {
      phase: 'known';
      robots: readonly ListedRobot[];
      publishAt: string | null;
      tookMs: number;
    }
  | { phase: 'unreachable'; robots: readonly ListedRobot[] };

/** Parses the robots in the relay's JSON answer. Entries without an id are skipped, members of a wrong type become null, and an
 *  unknown status counts as offline. */
export function readRobots(body: unknown): ListedRobot[] {
  const list = isRecord(body) ? body.robots : body;
  if (!Array.isArray(list)) return [];
  return list.filter(isRecord).flatMap((entry) => {
    const robot = entry.robot;
    if (typeof robot !== 'string') return [];
    const { status } = entry;
    return [
      {
        robot,
        name: isolated(typeof entry.name === 'string' && entry.name !== '' ? entry.name : robot),
        state: status === 'online' || status === 'silent' ? status : 'offline',
        ageMs: typeof entry.age_ms === 'number' ? entry.age_ms : null,
        viewers: typeof entry.viewers === 'number' ? entry.viewers : null,
        model: typeof entry.model === 'string' && /^[0-9a-f]{64}$/.test(entry.model) ? entry.model : null,
      },
    ];
  });
}

/** The endpoint in the relay's answer that needs no credential; null unless it is a loopback endpoint, the only kind allowed in a
 *  command for copying. */
export function readPublishAt(body: unknown): string | null {
  const at = isRecord(body) ? body.publish_at : null;
  return typeof at === 'string' && /^tcp\/(127\.0\.0\.1|\[::1\]|localhost):\d{1,5}$/.test(at) ? at : null;
}

/** The verdict about a listed robot, when the list arrived `tookMs` after it was requested. */
export function judgeListed({ state, ageMs }: ListedRobot, tookMs: number): Verdict {
  const status = { robot: state, ageMs: ageMs ?? 0, seq: null, degraded: false, overShare: false };
  const evidence = {
    ...{ openedMs: Number.NEGATIVE_INFINITY, connected: true, lostMs: null, heardMs: 0, transitMs: tookMs },
    ...{ freshMs: null, changedMs: null, watchingMs: null, shownMs: null, otherwiseMs: null },
    status: { ...status, atMs: -tookMs },
    holdUps: new HoldUps(),
  };
  return judge(evidence, 0);
}

/** The robots on air, moving ones first, and the robots that were on air, most recent first. Ties are sorted by name. */
export function inOrder(robots: readonly ListedRobot[]): [here: ListedRobot[], gone: ListedRobot[]] {
  const byName = [...robots].sort((a, b) => a.name.localeCompare(b.name));
  const here = byName.filter(({ state }) => state !== 'offline');
  const gone = byName.filter(({ state }) => state === 'offline');
  here.sort((a, b) => Number(a.state === 'silent') - Number(b.state === 'silent'));
  gone.sort((a, b) => (a.ageMs ?? Number.MAX_VALUE) - (b.ageMs ?? Number.MAX_VALUE));
  return [here, gone];
}

/** The list of robots, requested from the relay every 2 s while the page is visible, and at once after signing in or out. */
export function useRobots(): RobotListing {
  const [listing, setListing] = useState<RobotListing>({ phase: 'waiting' });
  useEffect(() => {
    const leave = new AbortController();
    let asking = false;

    const ask = async () => {
      if (asking || document.hidden) return;
      asking = true;
      try {
        const signal = AbortSignal.any([leave.signal, AbortSignal.timeout(LATE_MS)]);
        const askedMs = performance.now();
        let answer = await get(signal, tokenFor(apiUrl('robots')));
        // if the token is rejected, ask for what anyone may see
        if (answer.status === 401 || answer.status === 403) answer = await get(signal, undefined);
        if (!answer.ok) throw new Error(answer.statusText);
        const body: unknown = await answer.json();
        const tookMs = performance.now() - askedMs;
        const publishAt = readPublishAt(body);
        setListing({ phase: 'known', robots: readRobots(body), publishAt, tookMs });
      } catch {
        if (leave.signal.aborted) return;
        setListing((before) => ({
          phase: 'unreachable',
          robots: before.phase === 'waiting' ? [] : before.robots,
        }));
      } finally {
        asking = false;
      }
    };
    // a browser may ask for a password each time
    const timer = setInterval(() => signInNeeded.get() || void ask(), EVERY_MS);
    document.addEventListener('visibilitychange', ask, { signal: leave.signal });
    leave.signal.addEventListener(
      'abort',
      onAccountToken(() => void ask()),
    );
    void ask();
    return () => {
      clearInterval(timer);
      leave.abort();
    };
  }, []);
  return listing;
}

function get(signal: AbortSignal, token: string | undefined): Promise<Response> {
  const headers: HeadersInit = token ? { authorization: `Bearer ${token}` } : {};
  return request(apiUrl('robots'), { signal, cache: 'no-cache', headers });
}

function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}
