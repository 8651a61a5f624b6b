import { type RefObject, useEffect, useState } from 'react';
import { relayChoice } from '../../../relay/relay.ts';
import { useMedia } from '../../shell/media.ts';

/** If the list took longer than this to load, the connection is too slow for previews. */
const SLOW_ANSWER_MS = 1500;
const SCROLL_SETTLED_MS = 250;

interface Line {
  saveData?: boolean;
  effectiveType?: string;
}

/** Whether the connection and the viewer's settings allow a moving preview. `answerMs`: how long the list took. */
export function mayMove(line: Line | undefined, answerMs: number, reducedMotion: boolean): boolean {
  const slow = line?.saveData === true || /2g|3g/.test(line?.effectiveType ?? '');
  return !reducedMotion && !slow && answerMs < SLOW_ANSWER_MS;
}

/** The id of the robot whose card has a moving preview: the card under the pointer or in focus, or without a pointer the one in
 *  the middle of the screen; null for none. Cards in `list` carry their robot's id in `data-robot`. */
export function useMovingCard(list: RefObject<HTMLElement | null>, answerMs: number): string | null {
  const [robot, setRobot] = useState<string | null>(null);
  const reduced = useMedia('(prefers-reduced-motion: reduce), (prefers-reduced-data: reduce)');
  const pointed = useMedia('(hover: hover)');
  const line = (navigator as { connection?: Line }).connection;
  // only a robot's own page reads a mirror, and where a lane is configured only viewers with a token open a socket
  const { mirror, lane } = relayChoice();
  const may = mayMove(line, answerMs, reduced) && mirror === null && lane === null;
  useEffect(() => {
    const { current } = list;
    if (!may || current === null) return;
    const leave = new AbortController();
    const { signal } = leave;
    const take = (at: EventTarget | Element | null) =>
      setRobot(
        at instanceof Element ? (at.closest<HTMLElement>('[data-robot]')?.dataset.robot ?? null) : null,
      );
    if (pointed) {
      current.addEventListener('pointerover', ({ target }) => take(target), { signal });
      current.addEventListener('pointerleave', () => take(null), { signal });
      current.addEventListener('focusin', ({ target }) => take(target), { signal });
      current.addEventListener('focusout', () => take(null), { signal });
    } else {
      let timer = 0;
      const middle = () => take(document.elementFromPoint(window.innerWidth / 2, window.innerHeight / 2));
      const later = () => {
        clearTimeout(timer);
        timer = window.setTimeout(middle, SCROLL_SETTLED_MS);
      };
      for (const event of ['scroll', 'resize']) window.addEventListener(event, later, { signal });
      signal.addEventListener('abort', () => clearTimeout(timer));
      later();
    }
    document.addEventListener('visibilitychange', () => document.hidden && take(null), { signal });
    return () => {
      leave.abort();
      setRobot(null);
    };
  }, [list, may, pointed]);
  return robot;
}
