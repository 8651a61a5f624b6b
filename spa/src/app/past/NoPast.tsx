import './time_line/past.css';
import { useEffect, useState } from 'react';
import { usePastText } from '../text/past.ts';

/** Long enough to be read twice, ms. */
const SAID_MS = 15_000;

/** Says, where the time line would be, that the moment that a link named can't be looked at here. */
export function NoPast() {
  const text = usePastText();
  const [said, setSaid] = useState(false);
  useEffect(() => {
    const timer = setTimeout(() => setSaid(true), SAID_MS);
    return () => clearTimeout(timer);
  }, []);
  if (said) return null;
  return (
    <section className="time-line" aria-label={text.timeLine}>
      <p className="past-note" role="status" data-testid="past-note">
        {text.noPast}
      </p>
    </section>
  );
}
