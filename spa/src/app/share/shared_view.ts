import type { EyePlace } from '../../view/body_view.ts';
import type { Settings } from '../state/settings.ts';

/** What a link says beside the robot: `#/r/demo?shown=both&angle=deg&joint=RKN&eye=2.1,0.4,1.2,0,0,0.6`. */
export interface SharedView {
  readonly joint: string | null;
  /** From the floor under the middle of the robot, metres; null: the first view. */
  readonly eye: EyePlace | null;
}

/** The settings that travel in a link, and what they are when it does not name them. */
export const USUAL = {
  shown: 'pos',
  load: 'off',
  angle: 'rad',
  theme: 'system',
} as const satisfies Partial<Settings>;

/** Places farther away than this are not accepted. */
const FARTHEST_M = 1000;

/** Reads the view from an address; invalid parts are left out. */
export function readShared(query: URLSearchParams): SharedView {
  const joint = query.get('joint');
  // letters, not halves of them: half a pair can't stand in an address
  const named = joint ? [...joint].slice(0, 200).join('') : null;
  return { joint: named, eye: eyeOf(query.get('eye')) };
}

/** In the order in which people read it; nothing where all is as usual. */
export function sharedQuery(chosen: Pick<Settings, keyof typeof USUAL>, view: SharedView): string {
  const parts: string[] = [];
  for (const key of Object.keys(USUAL) as (keyof typeof USUAL)[]) {
    if (chosen[key] !== USUAL[key]) parts.push(`${key}=${chosen[key]}`);
  }
  if (view.joint !== null) parts.push(`joint=${encodeURIComponent(view.joint)}`);
  if (view.eye !== null) {
    const { position, target } = view.eye;
    parts.push(`eye=${[...position, ...target].map((metres) => Number(metres.toFixed(2))).join(',')}`);
  }
  return parts.length === 0 ? '' : `?${parts.join('&')}`;
}

function eyeOf(text: string | null): EyePlace | null {
  const numbers = (text ?? '').split(',').map((part) => (part.trim() === '' ? Number.NaN : Number(part)));
  if (numbers.length !== 6 || !numbers.every((metres) => Math.abs(metres) < FARTHEST_M)) return null;
  const [px, py, pz, tx, ty, tz] = numbers as [number, number, number, number, number, number];
  if (Math.hypot(px - tx, py - ty, pz - tz) < 0.01) return null;
  return { position: [px, py, pz], target: [tx, ty, tz] };
}
