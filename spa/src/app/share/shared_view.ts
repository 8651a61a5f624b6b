import type { EyePlace } from '../../scene/figure/body_view.ts';
import { formatMoment } from '../state/moment.ts';
import type { Settings } from '../state/settings.ts';

/** The parts of a shared link other than settings: `#/r/demo?t=2026-11-22T14:02:07.250Z&joint=RKN&eye=2.1,0.4,1.2,0,0,0.6`. */
export interface SharedView {
  /** The moment of the past, unix ms by the relay's clock; null: the present. */
  readonly momentMs: number | null;
  /** The selected joint; null: none. */
  readonly joint: string | null;
  /** The camera, metres from the floor under the robot's middle; null: the first view. In a link: position x,y,z, then
   *  target x,y,z. */
  readonly eye: EyePlace | null;
}

/** The settings that a shared link can name, with the values that it leaves out. */
export const USUAL = {
  shown: 'pos',
  load: 'off',
  angle: 'rad',
  theme: 'system',
} as const satisfies Partial<Settings>;

/** A camera coordinate of this size or more is not accepted. */
const FARTHEST_M = 1000;

/** Reads the view from the query of an address. Missing and invalid parts are null. */
export function readShared(query: URLSearchParams): Pick<SharedView, 'joint' | 'eye'> {
  const joint = query.get('joint');
  // cut by code points: half of a surrogate pair can't be written into an address
  const named = joint ? [...joint].slice(0, 200).join('') : null;
  return { joint: named, eye: eyeOf(query.get('eye')) };
}

/** The query of an address, with its `?`, that names the moment, the settings other than `USUAL`, the joint and the camera (in cm
 *  precision); empty if there is nothing to name. */
export function sharedQuery(chosen: Pick<Settings, keyof typeof USUAL>, view: SharedView): string {
  const parts: string[] = [];
  if (view.momentMs !== null) parts.push(`t=${formatMoment(view.momentMs)}`);
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
