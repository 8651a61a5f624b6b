import { Dialog } from '../shell/Dialog.tsx';
import { type KeyAction, PAGE_KEYS, signOf } from '../shell/page_keys.ts';
import { pastControls } from '../state/viewing.ts';
import { useMore } from '../text/language.ts';

/** A dialog with all keyboard shortcuts. */
export function KeysSheet({ onClose }: { onClose: () => void }) {
  return (
    <Dialog title={useMore().keys} testId="keys" onClose={onClose}>
      <KeysList />
    </Dialog>
  );
}

/** All keyboard shortcuts, in groups. */
export function KeysList() {
  const rest = useMore();
  const isRecording = pastControls.get()?.playhead.recorded != null;
  const groups = [
    [rest.keysOfPage, ['page']],
    [isRecording ? rest.keysOfRecording : rest.keysOfPast, ['past', 'line']],
    [rest.keysOfCamera, ['camera']],
  ] as const;
  return groups.map(([title, places]) => (
    <section className="keys" aria-label={title} key={title}>
      <h3 className="quiet">{title}</h3>
      <dl>
        {[...listKeys(places, isRecording), ...(title === rest.keysOfPage ? OF_ELEMENTS : [])].map(
          ({ says, signs }) => (
            <div key={says}>
              <dt>{says === 'keyMove' ? rest.keyShiftArrows : signs}</dt>
              <dd>{rest[says]}</dd>
            </div>
          ),
        )}
      </dl>
    </section>
  ));
}

/** Keys that browsers and elements handle themselves. */
const OF_ELEMENTS = [
  { says: 'keyTab', signs: 'Tab, Enter' },
  { says: 'keyArrows', signs: '← →' },
] as const;

const ARROWS: Readonly<Record<string, string>> = {
  ArrowLeft: '←',
  ArrowRight: '→',
  ArrowUp: '↑',
  ArrowDown: '↓',
};

/** The keys in some places by description, the first of each action, but all arrows of the camera. A recording has no present. */
function listKeys(places: readonly string[], isRecording: boolean) {
  const listed = new Map<(typeof PAGE_KEYS)[KeyAction]['says'] | 'keyRecordedEnds', string[]>();
  for (const action of Object.keys(PAGE_KEYS) as KeyAction[]) {
    const { where, says, keys } = PAGE_KEYS[action];
    if (!places.includes(where) || (isRecording && action === 'live')) continue;
    const said = isRecording && says === 'keyEnds' ? 'keyRecordedEnds' : says;
    const shown = action === 'turn' ? keys : [keys[0]];
    listed.set(said, [...(listed.get(said) ?? []), ...shown.map((key) => ARROWS[key] ?? signOf(key))]);
  }
  return [...listed].map(([says, signs]) => ({ says, signs: signs.join(' ') }));
}
