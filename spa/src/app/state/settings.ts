import { readStored, writeStored } from '../../browser/storage.ts';
import { createStore } from '../../kit.ts';
import type { FollowMode } from '../../scene/figure/body_view.ts';
import type { SignSettings } from '../../scene/signs/sign.ts';
import type { AngleUnit } from '../../twin/format.ts';
import { limitedNames } from '../../twin/joints.ts';
import { useStore } from './hooks.ts';

/** The settings of the page. They are kept in this browser and never sent. */
export interface Settings extends SignSettings {
  theme: 'system' | 'dark' | 'light';
  language: 'system' | 'en' | 'ko';
  /** How the body is drawn; `auto`: in 3D if the browser has it and the device is fast enough. */
  body: 'auto' | '3d' | 'light';
  /** Interpolates between poses; off: each pose is shown when it arrives. */
  smooth: boolean;
  panelOpen: boolean;
  /** Width of the panel, CSS px; null until the divider is moved. */
  panelPx: number | null;
  faultsFirst: boolean;
  /** Groups the joints of the table by limb. */
  limbs: boolean;
  /** Joint names: the robot's own (`RKN`), or plain words if available ("right knee"). */
  names: 'codes' | 'words';
  follow: FollowMode;
  /** Whether the page has keyboard shortcuts of one character, such as `T`. */
  characterKeys: boolean;
}

/** The range of `arrowScale`. */
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
  balance: 'auto',
  signs: {},
  arrowScale: 1,
  headingLocked: false,
  palette: 'standard',
  body: 'auto',
  smooth: true,
  panelOpen: true,
  panelPx: null,
  faultsFirst: true,
  limbs: false,
  names: 'codes',
  follow: 'along',
  characterKeys: true,
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
  load: (v): v is Settings['load'] => v === 'off' || limitedNames().some((name) => name === v),
  balance: (v): v is Settings['balance'] => v === 'auto' || v === 'on' || v === 'off',
  signs: (v): v is Settings['signs'] =>
    typeof v === 'object' && v !== null && Object.values(v).every(isSwitch),
  arrowScale: (v): v is number => typeof v === 'number' && v >= ARROWS.least && v <= ARROWS.most,
  headingLocked: isSwitch,
  palette: (v): v is Settings['palette'] => v === 'standard' || v === 'safe',
  body: (v): v is Settings['body'] => v === 'auto' || v === '3d' || v === 'light',
  smooth: isSwitch,
  panelOpen: isSwitch,
  panelPx: (v): v is number | null => v === null || (typeof v === 'number' && v >= 200 && v <= 4000),
  faultsFirst: isSwitch,
  limbs: isSwitch,
  names: (v): v is Settings['names'] => v === 'codes' || v === 'words',
  follow: (v): v is FollowMode => v === 'stay' || v === 'along' || v === 'turn',
  characterKeys: isSwitch,
};

/** Reads settings from JSON. Missing and invalid members get their defaults; null and invalid JSON give all defaults. */
export function readSettings(text: string | null): Settings {
  let stored: unknown = null;
  try {
    stored = JSON.parse(text ?? 'null');
  } catch {
    // treated like nothing stored
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
/** Settings given by a link. Each applies to this page until the viewer changes it, and is not stored. */
let lent: Partial<Settings> = {};
const inForce = createStore(own);

/** The current settings: the viewer's own, overridden by those from a link. */
export const settings = inForce.get;
/** Adds a listener for changes of the current settings. Returns a function that removes it. */
export const onSettings = inForce.subscribe;

/** Changes and stores some of the settings. They override values from a link. */
export function changeSettings(changed: Partial<Settings>): void {
  own = { ...own, ...changed };
  lent = Object.fromEntries(Object.entries(lent).filter(([key]) => !(key in changed)));
  writeStored(KEY, JSON.stringify(own));
  inForce.set({ ...own, ...lent });
}

/** Applies the settings in a link, without storing them. Unknown names and values are ignored, as are settings that are not text,
 *  such as numbers and switches. */
export function applyLinkSettings(query: URLSearchParams): void {
  const named = readSettings(JSON.stringify(Object.fromEntries(query)));
  const known = (Object.keys(named) as (keyof Settings)[]).filter((key) => query.get(key) === named[key]);
  if (known.length === 0) return;
  lent = { ...lent, ...Object.fromEntries(known.map((key) => [key, named[key]])) };
  inForce.set({ ...own, ...lent });
}

/** The current settings. The component is redrawn when they change. */
export function useSettings(): Settings {
  return useStore(inForce);
}
