import { useEffect, useState } from 'react';
import { nowMs } from '../../stream/clock.ts';

/** The present, a few times a second: for words that tell how long something has lasted. */
export function useNow(everyMs: number): number {
  const [now, setNow] = useState(nowMs);
  useEffect(() => {
    setNow(nowMs());
    const timer = setInterval(() => setNow(nowMs()), everyMs);
    return () => clearInterval(timer);
  }, [everyMs]);
  return now;
}
