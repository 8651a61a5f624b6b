import { asAnyone } from '../../relay/as_anyone.ts';
import { useMore } from '../text/more.ts';
import './as_anyone.css';

/** Where the page shows what anyone may see, says so and leads back to what its owner sees. */
export function AsAnyone() {
  const rest = useMore();
  if (!asAnyone()) return null;
  const { pathname, search, hash } = window.location;
  const without = new URLSearchParams(search);
  without.delete('as');
  return (
    <p className="as-anyone" role="status" data-testid="as-anyone">
      <span>{rest.seenAsAnyone}</span>
      <a className="text-button" href={`${pathname}${without.size > 0 ? `?${without}` : ''}${hash}`}>
        {rest.asYourself}
      </a>
    </p>
  );
}
