import type { ViewName } from '../../../scene/camera/framing.ts';
import { limitedNames } from '../../../twin/joints.ts';
import { isClaim } from '../../../twin/liveness.ts';
import { shownScene } from '../../shell/debug_api.ts';
import type { RobotLink } from '../../state/robot_link.ts';
import { applyLinkSettings, type Settings } from '../../state/settings.ts';
import { pastControls, selectJoint } from '../../state/viewing.ts';

/** A message from the page around a frame: `{posecast: 'look', view: 'side'}`. */
export type ParentRequest =
  | { posecast: 'look'; view: ViewName }
  /** A joint by the robot's name for it; null: none. */
  | { posecast: 'select'; joint: string | null }
  /** To play on from the moment of the past that it shows, as every recording does. */
  | { posecast: 'play' }
  | { posecast: 'set'; changed: Partial<Pick<Settings, 'shown' | 'load' | 'angle' | 'theme'>> };

/** The message that a frame sends: once when it is ready, then whenever its state word or its delay changes. */
export interface Told {
  posecast: 'ready' | 'liveness';
  robot: string;
  /** LIVE, HOLDING, STALE, OFFLINE, PAST; null while nothing is known. */
  word: string | null;
  cause: string | null;
  age_ms: number | null;
  /** The delay of a picture called LIVE or HOLDING, ms; null: none. */
  behind_ms: number | null;
  /** The moment of the past that is shown, unix ms; null unless the state word is PAST. */
  moment_ms: number | null;
}

const VIEWS = ['home', 'front', 'side', 'top'] as const;
const CHOICES = {
  shown: ['pos', 'ref', 'both'],
  load: ['off', ...limitedNames()],
  angle: ['rad', 'deg'],
  theme: ['system', 'dark', 'light'],
} as const;

/** Null if the message is not one that a frame knows. */
export function readParentRequest(data: unknown): ParentRequest | null {
  if (typeof data !== 'object' || data === null) return null;
  const { posecast, view, joint } = data as Record<string, unknown>;
  if (posecast === 'look') {
    const named = VIEWS.find((one) => one === view);
    return named === undefined ? null : { posecast, view: named };
  }
  if (posecast === 'select') {
    return joint === null || typeof joint === 'string' ? { posecast, joint } : null;
  }
  if (posecast === 'play') return { posecast };
  if (posecast !== 'set') return null;
  const changed = Object.entries(CHOICES).flatMap(([key, words]) => {
    const value = (data as Record<string, unknown>)[key];
    return (words as readonly unknown[]).includes(value) ? [[key, value]] : [];
  });
  return changed.length === 0 ? null : { posecast, changed: Object.fromEntries(changed) };
}

/** The origin of the page around the frame, as the frame's address names it: `?origin=https://course.example`. The frame
 *  exchanges messages with this origin only. */
export function parentOrigin(search: string): string | null {
  const asked = new URLSearchParams(search).get('origin');
  if (asked === null) return null;
  try {
    const { origin, protocol } = new URL(asked);
    return protocol === 'https:' || protocol === 'http:' ? origin : null;
  } catch {
    return null;
  }
}

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
      shownScene.get()?.look(wish.view);
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
