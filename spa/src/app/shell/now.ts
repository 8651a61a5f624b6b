import { useEffect, useState } from 'react';
import { nowMs } from '../../stream/clock.ts';

/** The time, Unix ms by the page's clock, which never steps back. The component is drawn again every `everyMs`, for texts
 *  that say how long something has lasted. */
export function useNow(everyMs: number): number {
  const [now, setNow] = useState(nowMs);
  useEffect(() => {
    setNow(nowMs());
    const timer = setInterval(() => setNow(nowMs()), everyMs);
    return () => clearInterval(timer);
  }, [everyMs]);
  return now;
}
