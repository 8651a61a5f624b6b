import { useSyncExternalStore } from 'react';
import { formatClockSeconds } from '../../../twin/format.ts';
import { pastControls } from '../../state/moment.ts';
import { useStore } from '../../state/use_store.ts';
import { useMore } from '../../text/more.ts';

/** What led up to a fault is seen from here on. */
const BEFORE_MS = 2000;

const never = () => () => {};

/** When something happened (unix ms by the relay's clock; null: not known). Where the past is kept, a button that shows it,
 *  as large as its row. `title`: what else the row tells a mouse. */
export function When({ atMs, title }: { atMs: number | null; title?: string | undefined }) {
  const controls = useStore(pastControls);
  const text = useMore();
  const fromMs = useSyncExternalStore(
    controls?.onChange ?? never,
    () => controls?.timeline?.fromMs ?? Number.POSITIVE_INFINITY,
  );
  if (atMs === null) return <time>—</time>;
  const clock = formatClockSeconds(atMs);
  if (atMs < fromMs) return <time>{clock}</time>;
  return (
    <button
      type="button"
      className="text-button when"
      title={title === undefined ? text.lookBack : `${title} · ${text.lookBack}`}
      aria-label={`${text.lookBack}: ${clock}`}
      onClick={() => controls?.seek(atMs - BEFORE_MS)}
    >
      <time>{clock}</time>
    </button>
  );
}
