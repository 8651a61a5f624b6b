import { asAnyone } from '../../relay/as_anyone.ts';
import { useMore } from '../text/more.ts';
import './as_anyone.css';

/** A note that the page shows only what anyone may see, with a link to the same view with the viewer's own rights. Empty
 *  unless the address has `?as=anyone`. */
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
