import { useSyncExternalStore } from 'react';
import { changeSettings, useSettings } from '../../state/settings.ts';
import { useMore } from '../../text/more.ts';
import { filterText, onFilter, setFilter } from './filter.ts';

/** The tools of the joint table: filter, sort order and unit. */
export function TableTools() {
  const filter = useSyncExternalStore(onFilter, filterText);
  const { limbs, angle } = useSettings();
  const text = useMore();
  const [now, other] = angle === 'rad' ? [text.inRadians, text.inDegrees] : [text.inDegrees, text.inRadians];
  return (
    <>
      <input
        type="search"
        className="filter"
        data-testid="filter"
        placeholder={text.filter}
        aria-label={text.filterJoints}
        value={filter}
        onChange={(event) => setFilter(event.target.value)}
        onKeyDown={(event) => event.key === 'Escape' && setFilter('')}
      />
      <button
        type="button"
        className="tool"
        aria-pressed={limbs}
        data-testid="limbs"
        title={text.limbByLimb}
        onClick={() => changeSettings({ limbs: !limbs })}
      >
        {text.limbs}
      </button>
      <button
        type="button"
        className="tool"
        data-testid="angle"
        aria-label={`${angle}: ${text.changeIt(now)}`}
        title={other}
        onClick={() => changeSettings({ angle: angle === 'rad' ? 'deg' : 'rad' })}
      >
        {angle}
      </button>
    </>
  );
}
