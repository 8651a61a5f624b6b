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
    const { state } = entry;
    return [
      {
        robot,
        name: typeof entry.name === 'string' && entry.name !== '' ? entry.name : robot,
        state: state === 'online' || state === 'silent' ? state : 'offline',
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
    let timer: ReturnType<typeof setTimeout> | null = null;
    let asking: AbortController | null = null;

    const ask = async () => {
      timer = null;
      asking = new AbortController();
      const { signal } = asking;
      const late = setTimeout(() => asking?.abort(), LATE_MS);
      try {
        const answer = await fetch(apiUrl('robots'), { signal, cache: 'no-cache' });
        if (!answer.ok) throw new Error(`${answer.status}`);
        const robots = readRobots(await answer.json());
        setListing({ phase: 'known', robots });
      } catch {
        if (timer === null && asking?.signal === signal && !left) {
          setListing((before) => ({
            phase: 'unreachable',
            robots: before.phase === 'waiting' ? [] : before.robots,
          }));
        }
      } finally {
        clearTimeout(late);
        if (!left && !document.hidden) timer = setTimeout(ask, EVERY_MS);
      }
    };
    let left = false;
    const onVisible = () => {
      if (document.hidden || timer !== null) return;
      void ask();
    };
    document.addEventListener('visibilitychange', onVisible);
    void ask();
    return () => {
      left = true;
      if (timer !== null) clearTimeout(timer);
      asking?.abort();
      document.removeEventListener('visibilitychange', onVisible);
    };
  }, []);
  return listing;
}

function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}
