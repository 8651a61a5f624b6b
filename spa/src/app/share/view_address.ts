import type { Emitter } from '../../kit.ts';
import type { BodyView, EyePlace } from '../../scene/figure/body_view.ts';
import { address, formatMoment, onLink, placeIn, queryOf, writeHash } from '../state/address.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { onSettings, type Settings, settings } from '../state/settings.ts';
import {
  onPresenting,
  onSelection,
  presenting,
  selection,
  selectJoint,
  shownMoment,
} from '../state/viewing.ts';

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

/** A change is written once it has lasted this long, ms. */
const SETTLE_MS = 500;
/** Approximate interval between two updates while the past plays: browsers allow a page 100 in 30 s. */
const PLAYED_EVERY_MS = 970;

/**
 * Keeps the page's address in step with what it shows, so that a copy of the address opens the same view. At first, and when the
 * address changes, the camera and the selected joint are taken from it; an unknown joint is ignored. `drawn` tells of each picture,
 * in which the camera may have moved. Returns a function that stops it.
 */
export function bindAddress(view: BodyView, { twin }: RobotLink, drawn: Emitter): () => void {
  let wanted: string | null = null;
  let placed = false;
  /** The address that has been taken or written. */
  let known = '';
  const take = () => {
    known = address.get();
    const { joint, eye } = readShared(queryOf(known));
    placed = eye !== null;
    if (eye !== null) view.standAt(eye);
    wanted = joint;
    choose();
  };
  const choose = () => {
    if (wanted === null || twin.schema === null) return;
    // 'body' keeps the camera where the address put it
    if (twin.schema.field('pos')?.labels.includes(wanted)) selectJoint(wanted, placed ? 'body' : 'numbers');
    wanted = null;
  };

  let before = '';
  let timer: ReturnType<typeof setTimeout> | undefined;
  let wroteMs = Number.NEGATIVE_INFINITY;
  const look = () => {
    timer = undefined;
    const hash = address.get();
    if (hash !== known || wanted !== null) return;
    const moment = shownMoment.get();
    const shown = { joint: selection()?.joint ?? null, eye: view.stand, momentMs: moment };
    const shared = sharedQuery(settings(), shown);
    const query = presenting() ? `${shared === '' ? '?' : `${shared}&`}present` : shared;
    const now = (placeIn(hash) || '#/') + query; // a recording needs no place
    const leftMs = moment === null ? SETTLE_MS : wroteMs + PLAYED_EVERY_MS - performance.now();
    const isSettled = query === before;
    before = query;
    if (now === hash) return;
    if (!isSettled && leftMs > 0) {
      timer = setTimeout(look, Math.min(SETTLE_MS, leftMs));
      return;
    }
    wroteMs = performance.now();
    writeHash(now);
    known = address.get();
  };
  const soon = () => {
    timer ??= setTimeout(look, SETTLE_MS);
  };
  const leave = [
    twin.onChange(choose),
    onLink(take),
    ...[drawn.on, onSettings, onSelection, onPresenting, shownMoment.subscribe].map((on) => on(soon)),
    () => clearTimeout(timer),
  ];
  take();
  soon();
  return () => {
    for (const off of leave) off();
  };
}
