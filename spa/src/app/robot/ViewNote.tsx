import { useMore } from '../text/more.ts';
import type { ViewTrouble } from './use_body_view.ts';
import { viewWords } from './words.ts';

/** A note that says why the body is not drawn in full 3D quality, with a button for the other renderer if that can help. */
export function ViewNote({
  trouble,
  choose,
}: {
  trouble: ViewTrouble;
  choose: (way: '3d' | 'light') => void;
}) {
  const text = useMore();
  return (
    <p data-testid="view-note" data-trouble={trouble} role="status">
      {viewWords(trouble)}
      {(trouble === 'given-up' || trouble === 'slow' || trouble === 'chosen') && (
        <button type="button" className="text-button" onClick={() => choose('3d')}>
          {trouble === 'chosen' ? text.backTo3d : text.try3d}
        </button>
      )}
      {(trouble === 'pixels' || trouble === 'detail') && (
        <button type="button" className="text-button" onClick={() => choose('light')}>
          {text.lightView}
        </button>
      )}
    </p>
  );
}
