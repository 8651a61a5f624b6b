import { isClaim } from '../../../twin/liveness.ts';
import { shownScene } from '../../shell/debug_api.ts';
import { pastControls } from '../../state/moment.ts';
import type { RobotLink } from '../../state/robot_link.ts';
import { selectJoint } from '../../state/selection.ts';
import { applyLinkSettings } from '../../state/settings.ts';
import { type ParentRequest, parentOrigin, readParentRequest, type Told } from './messages.ts';

/** Exchanges messages with the page around this frame if the address names its origin. Returns a function that stops it. */
export function connectParent({ twin, watch, client }: RobotLink): () => void {
  const origin = parentOrigin(window.location.search);
  if (origin === null || window.parent === window) return () => {};

  const tell = (posecast: Told['posecast']) => {
    const { word, cause, ageMs, past } = watch.verdict();
    const moment_ms = past?.momentMs ?? null;
    const behind_ms = isClaim(word) ? client.link.behindMs : null;
    const told: Told = { posecast, robot: twin.robot, word, cause, age_ms: ageMs, behind_ms, moment_ms };
    window.parent.postMessage(told, origin);
  };
  const hear = (event: MessageEvent<unknown>) => {
    if (event.source !== window.parent || event.origin !== origin) return;
    const wish = readParentRequest(event.data);
    if (wish !== null) grant(wish);
  };
  window.addEventListener('message', hear);
  let { behindMs } = client.link;
  const leave = [
    watch.onWord(() => tell('liveness')),
    client.onChange(() => {
      if (client.link.behindMs === behindMs) return;
      ({ behindMs } = client.link);
      tell('liveness');
    }),
  ];
  tell('ready');
  return () => {
    window.removeEventListener('message', hear);
    for (const off of leave) off();
  };
}

function grant(wish: ParentRequest): void {
  switch (wish.posecast) {
    case 'look':
      shownScene()?.look(wish.view);
      return;
    case 'select':
      selectJoint(wish.joint);
      return;
    case 'play': {
      const controls = pastControls.get();
      if (controls?.playhead.at === 'past' && !controls.playhead.playing) controls.toggle();
      return;
    }
    case 'set':
      applyLinkSettings(new URLSearchParams(wish.changed));
      return;
  }
}
