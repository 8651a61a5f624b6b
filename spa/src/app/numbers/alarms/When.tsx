import { useSyncExternalStore } from 'react';
import { formatClockSeconds } from '../../../twin/format.ts';
import { pastControls } from '../../state/moment.ts';
import { useStore } from '../../state/use_store.ts';
import { useMore } from '../../text/more.ts';

/** Playback starts this long before a fault, to show what led up to it. */
const BEFORE_MS = 2000;

const never = () => () => {};

/** When something happened (unix ms by the relay's clock; null if unknown). If the past is kept, it is a button as large as its
 *  row that shows that moment. `title`: the rest of the row's tooltip. */
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
