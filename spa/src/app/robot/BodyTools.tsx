import '../shell/styles/tools.css';
import { useRef, useState } from 'react';
import type { BodyView } from '../../scene/figure/body_view.ts';
import { SettingChoice } from '../shell/SettingChoice.tsx';
import { type RobotLink, useVersion } from '../state/robot_link.ts';
import { useMore } from '../text/language.ts';
import { bytesWords } from '../words/status.ts';
import { SignMenu } from './SignMenu.tsx';

/** The tools over the body: camera views, displayed values, overlay. */
export function BodyTools({ link, view, shown }: { link: RobotLink; view: BodyView; shown: boolean }) {
  useVersion(link);
  const hasRef = link.twin.schema?.field('ref') != null;
  return (
    <div className="stage-tools">
      {hasRef && <ShownChoice />}
      <CameraViews scene={view} />
      <SignMenu links={[link]} drawsBalance={view.drawsBalance} />
      {shown && <Finer scene={view} />}
    </div>
  );
}

/** A button that loads the finest level of detail, if it is finer than what the page loads automatically. */
function Finer({ scene }: { scene: BodyView }) {
  const text = useMore();
  const [state, setState] = useState<'offered' | 'coming' | 'done' | 'failed'>('offered');
  const [received, setReceived] = useState(0);
  const bytes = useRef(scene.finerBytes);
  const room = useRef<HTMLFieldSetElement>(null);
  if (bytes.current === null) return null;
  const size = bytes.current;
  const ask = () => {
    room.current?.style.setProperty('width', `${room.current.offsetWidth}px`);
    setState('coming');
    scene
      .refine((now) => setReceived(now))
      .then(
        () => setState('done'),
        () => setState('failed'),
      );
  };
  const words = {
    offered: text.finer(bytesWords(size, 0)),
    coming: bytesWords(received, size),
    failed: text.finerFailed,
    done: '',
  }[state];
  const isDone = state === 'done';
  return (
    // The button keeps its space, so that its neighbours don't move under the finger.
    <fieldset
      className="segments"
      ref={room}
      disabled={state === 'coming'}
      data-testid={isDone ? undefined : 'finer'}
      style={{ visibility: isDone ? 'hidden' : undefined }}
    >
      <legend className="unseen">{text.detail}</legend>
      <button type="button" onClick={ask} title={text.fullDetail}>
        {words}
      </button>
    </fieldset>
  );
}

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

/** The choice of the joint values that a body shows: pos, ref or both. */
export function ShownChoice() {
  const text = useMore();
  return (
    <fieldset className="segments">
      <legend className="unseen">{text.whatTheBodyShows}</legend>
      <SettingChoice
        name="shown"
        values={[
          ['pos', text.showPos, text.whereItIs],
          ['ref', text.showRef, text.whereTold],
          ['both', text.showBoth, text.whereBoth],
        ]}
      />
    </fieldset>
  );
}
