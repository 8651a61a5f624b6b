import type { BodyView } from '../../scene/figure/body_view.ts';
import { useMore } from '../text/more.ts';

/** Buttons for the camera views: initial, front, side and top. */
export function CameraViews({ scene }: { scene: Pick<BodyView, 'look'> }) {
  const text = useMore();
  return (
    <fieldset className="segments">
      <legend className="unseen">{text.camera}</legend>
      <button
        type="button"
        onClick={() => scene.look('home')}
        title={text.firstView}
        aria-label={text.firstView}
      >
        ↺
      </button>
      {(['front', 'side', 'top'] as const).map((side) => (
        <button key={side} type="button" onClick={() => scene.look(side)}>
          {text[side]}
        </button>
      ))}
    </fieldset>
  );
}
