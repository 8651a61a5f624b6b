import { formatClockSeconds } from '../../../twin/format.ts';
import { pastControls } from '../../state/moment.ts';
import { useStore } from '../../state/use_store.ts';
import { useMore } from '../../text/more.ts';

/** What led up to a fault is seen from here on. */
const BEFORE_MS = 2000;

/** When something happened (unix ms by the relay's clock; null: not known). Where the past is kept, a button that shows it. */
export function When({ atMs }: { atMs: number | null }) {
  const controls = useStore(pastControls);
  const text = useMore();
  if (atMs === null) return <time>—</time>;
  const clock = formatClockSeconds(atMs);
  const { timeline } = controls ?? {};
  if (timeline == null || atMs < timeline.fromMs) return <time>{clock}</time>;
  return (
    <button
      type="button"
      className="text-button when"
      title={text.lookBack}
      aria-label={`${text.lookBack}: ${clock}`}
      onClick={() => controls?.seek(atMs - BEFORE_MS)}
    >
      <time>{clock}</time>
    </button>
  );
}
