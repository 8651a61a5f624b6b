import { useSyncExternalStore } from 'react';
import type { AngleUnit } from '../twin/format.ts';

/** What a person chose for this browser. Kept locally; nothing of it is ever sent. */
export interface Settings {
  theme: 'system' | 'dark' | 'light';
  angle: AngleUnit;
  /** Which joint values the body shows. */
  shown: 'pos' | 'ref';
  panelOpen: boolean;
  /** Width of the panel in px; null until the divider was dragged. */
  panelPx: number | null;
  faultsFirst: boolean;
}

const KEY = 'posecast.settings';
const DEFAULTS: Settings = {
  theme: 'system',
  angle: 'rad',
  shown: 'pos',
  panelOpen: true,
  panelPx: null,
  faultsFirst: true,
};

const CHOICES: { readonly [K in keyof Settings]: (value: unknown) => value is Settings[K] } = {
  theme: (v): v is Settings['theme'] => v === 'system' || v === 'dark' || v === 'light',
  angle: (v): v is AngleUnit => v === 'rad' || v === 'deg',
  shown: (v): v is Settings['shown'] => v === 'pos' || v === 'ref',
  panelOpen: (v): v is boolean => typeof v === 'boolean',
  panelPx: (v): v is number | null => v === null || (typeof v === 'number' && v >= 200 && v <= 4000),
  faultsFirst: (v): v is boolean => typeof v === 'boolean',
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

/** Storage throws in a third-party iframe and in some private windows; then settings last as long as the page. */
function fromStorage(): string | null {
  try {
    return window.localStorage.getItem(KEY);
  } catch {
    return null;
  }
}

let current: Settings | null = null;
const listeners = new Set<() => void>();

export function settings(): Settings {
  current ??= readSettings(fromStorage());
  return current;
}

export function changeSettings(changed: Partial<Settings>): void {
  current = { ...settings(), ...changed };
  try {
    window.localStorage.setItem(KEY, JSON.stringify(current));
  } catch {
    // as above
  }
  for (const listener of listeners) listener();
}

export function onSettings(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

export function useSettings(): Settings {
  return useSyncExternalStore(onSettings, settings);
}
