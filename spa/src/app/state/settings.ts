import { readStored, writeStored } from '../../browser/storage.ts';
import { createStore } from '../../browser/store.ts';
import type { AngleUnit } from '../../twin/format.ts';
import type { LoadField } from '../../twin/sensors/load.ts';
import type { FollowMode, MouseStyle } from '../../view/body_view.ts';
import { useStore } from './use_store.ts';

/** What a person chose for this browser. Kept locally; nothing of it is ever sent. */
export interface Settings {
  theme: 'system' | 'dark' | 'light';
  language: 'system' | 'en' | 'ko';
  angle: AngleUnit;
  /** Which joint values the body shows. */
  shown: 'pos' | 'ref' | 'both';
  /** What is drawn beside the body: a ghost and arcs where ref and pos differ, forces and moments, what is level. */
  lens: boolean;
  forces: boolean;
  level: boolean;
  /** What the body is painted by. */
  load: 'off' | LoadField;
  /** How much longer than usual force arrows are. */
  arrowScale: number;
  /** The body faces one way, whatever its sensors say of its heading. */
  headingLocked: boolean;
  palette: 'standard' | 'safe';
  /** How the body is drawn; `auto`: in 3D where the browser has it and the device is fast enough. */
  body: 'auto' | '3d' | 'light';
  /** Motion between two poses; off: every pose when it comes. */
  smooth: boolean;
  panelOpen: boolean;
  /** Width of the panel in px; null until the divider was dragged. */
  panelPx: number | null;
  faultsFirst: boolean;
  /** Joints stand limb by limb. */
  limbs: boolean;
  mouse: MouseStyle;
  follow: FollowMode;
}

/** Of `arrowScale`. */
export const ARROWS = { least: 0.25, most: 4 } as const;

const KEY = 'posecast.settings';
const DEFAULTS: Settings = {
  theme: 'system',
  language: 'system',
  angle: 'rad',
  shown: 'pos',
  lens: true,
  forces: true,
  level: true,
  load: 'off',
  arrowScale: 1,
  headingLocked: false,
  palette: 'standard',
  body: 'auto',
  smooth: true,
  panelOpen: true,
  panelPx: null,
  faultsFirst: true,
  limbs: false,
  mouse: 'orbit',
  follow: 'along',
};

const isSwitch = (value: unknown): value is boolean => typeof value === 'boolean';

const CHOICES: { readonly [K in keyof Settings]: (value: unknown) => value is Settings[K] } = {
  theme: (v): v is Settings['theme'] => v === 'system' || v === 'dark' || v === 'light',
  language: (v): v is Settings['language'] => v === 'system' || v === 'en' || v === 'ko',
  angle: (v): v is AngleUnit => v === 'rad' || v === 'deg',
  shown: (v): v is Settings['shown'] => v === 'pos' || v === 'ref' || v === 'both',
  lens: isSwitch,
  forces: isSwitch,
  level: isSwitch,
  load: (v): v is Settings['load'] => v === 'off' || v === 'cur' || v === 'temp',
  arrowScale: (v): v is number => typeof v === 'number' && v >= ARROWS.least && v <= ARROWS.most,
  headingLocked: isSwitch,
  palette: (v): v is Settings['palette'] => v === 'standard' || v === 'safe',
  body: (v): v is Settings['body'] => v === 'auto' || v === '3d' || v === 'light',
  smooth: isSwitch,
  panelOpen: isSwitch,
  panelPx: (v): v is number | null => v === null || (typeof v === 'number' && v >= 200 && v <= 4000),
  faultsFirst: isSwitch,
  limbs: isSwitch,
  mouse: (v): v is MouseStyle => v === 'orbit' || v === 'foxglove',
  follow: (v): v is FollowMode => v === 'stay' || v === 'along' || v === 'turn',
};

/** Whatever storage holds, settings come out whole: a member that is missing or odd gets its default. */
export function readSettings(text: string | null): Settings {
  let stored: unknown = null;
  try {
    stored = JSON.parse(text ?? 'null');
  } catch {
    // as good as nothing stored
  }
  const settings = { ...DEFAULTS };
  if (typeof stored !== 'object' || stored === null) return settings;
  const take = <K extends keyof Settings>(key: K) => {
    const value: unknown = (stored as Record<string, unknown>)[key];
    if (CHOICES[key](value)) settings[key] = value;
  };
  for (const key of Object.keys(DEFAULTS) as (keyof Settings)[]) take(key);
  return settings;
}

let own = readSettings(readStored(KEY));
/** What a link has brought along: it holds on this page until the person chooses, and is not kept. */
let lent: Partial<Settings> = {};
const inForce = createStore(own);

export const settings = inForce.get;
export const onSettings = inForce.subscribe;

export function changeSettings(changed: Partial<Settings>): void {
  own = { ...own, ...changed };
  lent = Object.fromEntries(Object.entries(lent).filter(([key]) => !(key in changed)));
  writeStored(KEY, JSON.stringify(own));
  inForce.set({ ...own, ...lent });
}

/** What stands behind the page in an address. */
export function queryOf(hash: string): URLSearchParams {
  return new URLSearchParams(hash.split('?')[1] ?? '');
}

/** Takes over what a link says in so many words; a word that no setting knows is left out. */
export function applyLinkSettings(query: URLSearchParams): void {
  const named = readSettings(JSON.stringify(Object.fromEntries(query)));
  const known = (Object.keys(named) as (keyof Settings)[]).filter((key) => query.get(key) === named[key]);
  if (known.length === 0) return;
  lent = { ...lent, ...Object.fromEntries(known.map((key) => [key, named[key]])) };
  inForce.set({ ...own, ...lent });
}

export function useSettings(): Settings {
  return useStore(inForce);
}
