import { PAST_KEYS, RECORDING_KEYS } from '../../past/time_line/past_key_list.ts';
import { Dialog } from '../../shell/Dialog.tsx';
import { pastControls } from '../../state/moment.ts';
import { useMore } from '../../text/more.ts';
import { usePresentText } from '../../text/present.ts';
import { CameraKeys } from './CameraKeys.tsx';

/** A dialog with all keyboard shortcuts. */
export function KeysSheet({ onClose }: { onClose: () => void }) {
  const rest = useMore();
  const { keyPresent } = usePresentText();
  const [played, playedKeys] =
    pastControls.get()?.playhead.recorded == null
      ? [rest.keysOfPast, PAST_KEYS]
      : [rest.keysOfRecording, RECORDING_KEYS];
  const ofPage = [
    ['T', rest.keyNumbers],
    ['F', rest.keyFullscreen],
    ['P', keyPresent],
    ['S', rest.keyShare],
    ['?', rest.keyThese],
    ['Tab, Enter', rest.keyTab],
    ['← →', rest.keyArrows],
    ['Escape', rest.keyEscape],
  ] as const;
  return (
    <Dialog title={rest.keys} testId="keys" onClose={onClose}>
      <section className="keys" aria-label={rest.keysOfPage}>
        <h3 className="quiet">{rest.keysOfPage}</h3>
        <dl>
          {ofPage.map(([key, does]) => (
            <div key={key}>
              <dt>{key}</dt>
              <dd>{does}</dd>
            </div>
          ))}
        </dl>
      </section>
      <section className="keys" aria-label={played}>
        <h3 className="quiet">{played}</h3>
        <dl>
          {playedKeys.map(([key, does]) => (
            <div key={key}>
              <dt>{key}</dt>
              <dd>{rest[does]}</dd>
            </div>
          ))}
        </dl>
      </section>
      <section className="keys" aria-label={rest.keysOfCamera}>
        <h3 className="quiet">{rest.keysOfCamera}</h3>
        <CameraKeys />
      </section>
    </Dialog>
  );
}
