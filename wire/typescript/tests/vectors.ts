/** Reads `wire/vectors/`: scripts that any decoder can follow. */

import { readFileSync } from 'node:fs';

export interface Step {
  readonly note?: string;
  readonly schema?: string;
  readonly frame?: string;
  readonly is?: 'state' | 'unknown' | 'bad';
  readonly says?: string;
  readonly seq?: number;
  readonly t?: number;
  readonly codes?: readonly number[];
  readonly from?: {
    readonly codes: readonly number[];
    readonly seq: number;
    readonly t: number;
    readonly now: number;
    readonly force_key?: boolean;
  };
}

export interface Case {
  readonly name: string;
  readonly why: string;
  readonly steps: readonly Step[];
  readonly encode?: { readonly schema: string; readonly key_interval_s: number };
}

export interface Frames {
  readonly schemas: Readonly<Record<string, string>>;
  readonly cases: readonly Case[];
}

export interface Schemas {
  readonly bad: readonly { readonly where: string; readonly text: string }[];
  readonly good: readonly {
    readonly why: string;
    readonly text: string;
    readonly fields: readonly { name: string; labels: readonly string[]; scale: number }[];
  }[];
  readonly id: number;
  readonly mapping: {
    readonly text: string;
    readonly codes: readonly number[];
    readonly joints: Readonly<Record<string, Readonly<Record<string, number | null>>>>;
  };
}

export function load<T>(name: string): T {
  return JSON.parse(readFileSync(new URL(`../../${name}`, import.meta.url), 'utf8')) as T;
}

export const FRAME_FILES = ['valid', 'invalid', 'lossy', 'alternating'].map((name) => ({
  name,
  ...load<Frames>(`vectors/${name}.json`),
}));

export function bytes(hex: string): Uint8Array {
  return Uint8Array.from(hex.match(/../g) ?? [], (pair) => Number.parseInt(pair, 16));
}

export function hex(data: Uint8Array): string {
  return Array.from(data, (b) => b.toString(16).padStart(2, '0')).join('');
}
