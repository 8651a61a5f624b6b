import { useEffect, useState } from 'react';
import { apiUrl } from './robot_link.ts';

const EVERY_MS = 2000;
const LATE_MS = 6000;

/** A robot as the list knows it. */
export interface ListedRobot {
  robot: string;
  name: string;
  state: 'online' | 'silent' | 'offline';
  ageMs: number | null;
  viewers: number | null;
}

export type RobotListing =
  | { phase: 'waiting' }
  | { phase: 'known'; robots: readonly ListedRobot[] }
  | { phase: 'unreachable'; robots: readonly ListedRobot[] };

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
        name: typeof entry.name === 'string' && entry.name !== '' ? entry.name : robot,
        state: status === 'online' || status === 'silent' ? status : 'offline',
        ageMs: typeof entry.age_ms === 'number' ? entry.age_ms : null,
        viewers: typeof entry.viewers === 'number' ? entry.viewers : null,
      },
    ];
  });
}

/** What is on air, asked every two seconds while somebody looks. */
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
        const answer = await fetch(apiUrl('robots'), { signal, cache: 'no-cache' });
        if (!answer.ok) throw new Error(answer.statusText);
        setListing({ phase: 'known', robots: readRobots(await answer.json()) });
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
    const timer = setInterval(ask, EVERY_MS);
    document.addEventListener('visibilitychange', ask, { signal: leave.signal });
    void ask();
    return () => {
      clearInterval(timer);
      leave.abort();
    };
  }, []);
  return listing;
}

function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}
