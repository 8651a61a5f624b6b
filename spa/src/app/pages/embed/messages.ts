import type { ViewName } from '../../../view/camera/framing.ts';
import type { Settings } from '../../state/settings.ts';

/** What the page around a frame may ask: `{posecast: 'look', view: 'side'}`. */
export type ParentRequest =
  | { posecast: 'look'; view: ViewName }
  /** A joint as the robot names it; null: none. */
  | { posecast: 'select'; joint: string | null }
  /** To play on from the moment of the past that it shows, as every recording does. */
  | { posecast: 'play' }
  | { posecast: 'set'; changed: Partial<Pick<Settings, 'shown' | 'load' | 'angle' | 'theme'>> };

/** What a frame tells: once when it is ready, then whenever the word changes, or how far what it shows lies behind. */
export interface Told {
  posecast: 'ready' | 'liveness';
  robot: string;
  /** LIVE, HOLDING, STALE, OFFLINE, PAST; null while nothing is known. */
  word: string | null;
  cause: string | null;
  age_ms: number | null;
  /** How far what is called LIVE or HOLDING lies behind now, ms; null: not at all. */
  behind_ms: number | null;
  /** The moment of the past that is shown, unix ms; null unless the word is PAST. */
  moment_ms: number | null;
}

const VIEWS = ['home', 'front', 'side', 'top'] as const;
const CHOICES = {
  shown: ['pos', 'ref', 'both'],
  load: ['off', 'cur', 'temp'],
  angle: ['rad', 'deg'],
  theme: ['system', 'dark', 'light'],
} as const;

/** Null: none that a frame knows. */
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

/** The origin that the frame's address names as the page around it: `?origin=https://course.example`. Only it is heard and told. */
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
