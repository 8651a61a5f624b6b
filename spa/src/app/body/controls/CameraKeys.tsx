import { useMore } from '../../text/more.ts';
import { CAMERA_KEYS } from './camera_controls.ts';

/** A list of the keyboard shortcuts of the camera. */
export function CameraKeys() {
  const text = useMore();
  return (
    <dl>
      {CAMERA_KEYS.map(([keys, does]) => (
        <div key={keys}>
          <dt>{keys === 'Shift' ? text.keyShiftArrows : keys}</dt>
          <dd>{text[does]}</dd>
        </div>
      ))}
    </dl>
  );
}
