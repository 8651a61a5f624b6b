import { useEffect, useState } from 'react';
import { useMore } from '../text/more.ts';
import './no_past.css';

/** Long enough to be read twice, ms. */
const SAID_MS = 15_000;

/** Says, in place of the time line, that the moment in the link can't be shown here. */
export function NoPast({ why }: { why: 'noPast' | 'noMoment' }) {
  const text = useMore();
  const [said, setSaid] = useState(false);
  useEffect(() => {
    const timer = setTimeout(() => setSaid(true), SAID_MS);
    return () => clearTimeout(timer);
  }, []);
  if (said) return null;
  return (
    <p className="no-past" role="status" data-testid="past-note">
      {text[why]}
    </p>
  );
}
