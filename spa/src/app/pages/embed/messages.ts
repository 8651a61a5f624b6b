import type { ViewName } from '../../../scene/camera/framing.ts';
import type { Settings } from '../../state/settings.ts';

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
  load: ['off', 'cur', 'temp'],
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
