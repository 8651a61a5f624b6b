import { useEffect, useRef, useState } from 'react';
import { type RobotLink, useWord } from './robot_link.ts';

/** A listener hears a change of the word, and not more often than this. */
const EVERY_MS = 5000;

/** The word of the page for those who listen to it. */
export function Announcer({ link }: { link: RobotLink }) {
  const word = useWord(link);
  const [said, setSaid] = useState('');
  const saidMs = useRef(Number.NEGATIVE_INFINITY);
  useEffect(() => {
    const say = () => {
      const { cause } = link.watch.verdict();
      saidMs.current = performance.now();
      setSaid(
        word === null ? '' : `${link.twin.robot}: ${word.toLowerCase()}${cause === null ? '' : `, ${cause}`}`,
      );
    };
    const timer = setTimeout(say, Math.max(0, saidMs.current + EVERY_MS - performance.now()));
    return () => clearTimeout(timer);
  }, [word, link]);
  return (
    <p className="unseen" role="status" aria-live="polite">
      {said}
    </p>
  );
}
