/** The README's table of browsers: one row per engine, written and checked by the tests that measured it. */

import { readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import type { Ability, EngineName } from './driver/page.ts';
import { REPO } from './stack.ts';

export interface BrowserRow {
  readonly engine: EngineName;
  readonly version: string;
  /** Draw calls of the robot, and of the whole picture. */
  readonly robotCalls: number;
  readonly allCalls: number;
  readonly touch: string;
  readonly fullscreen: string;
  readonly withoutWebGl: string;
  /** What tests can't find out there. */
  readonly lacks: readonly Ability[];
}

const NAMES: Readonly<Record<EngineName, string>> = {
  chromium: 'Chromium',
  firefox: 'Firefox',
  webkitgtk: 'WebKitGTK',
};
const ABILITIES: Readonly<Record<Ability, string>> = {
  touch: 'touch',
  buttons: 'right button',
  wheel: 'wheel',
  drops: 'drag and drop',
  files: 'files from the desktop',
  media: 'settings of the system',
  colors: 'forced colours',
  slow: 'slow processor',
  stop: 'sleep',
  cache: 'cache',
};
const HEAD = `| browser | version | body in 3D | one finger turns it | fullscreen | without WebGL | not tested: its driver cannot |
|---|---|---|---|---|---|---|`;
const START = '<!-- browsers: written by `make browsers` -->';
const END = '<!-- /browsers -->';
const README = path.join(REPO, 'README.md');

function line(row: BrowserRow): string {
  const drawn = `✓ robot in ${calls(row.robotCalls)}, scene in ${row.allCalls}`;
  const unplayed = Object.entries(ABILITIES).filter(([ability]) => row.lacks.includes(ability as Ability));
  const cells = [
    ...[NAMES[row.engine], row.version, drawn, row.touch, row.fullscreen, row.withoutWebGl],
    unplayed.map(([, word]) => word).join(', ') || '—',
  ];
  return `| ${cells.join(' | ')} |`;
}

const calls = (n: number) => `${n} draw call${n === 1 ? '' : 's'}`;

/** `markdown` with this row in its place in the table. Throws an Error if there is no table. */
export function withRow(markdown: string, row: BrowserRow): string {
  const start = markdown.indexOf(START);
  const end = markdown.indexOf(END);
  if (start < 0 || end < start) throw new Error(`README.md has no place for the browsers: ${START} … ${END}`);
  const rows = linesOf(markdown).filter((there) => !isOf(row.engine, there));
  const order = Object.values(NAMES);
  const rank = (there: string) => order.findIndex((name) => there.startsWith(`| ${name} |`));
  const table = [...rows, line(row)].sort((a, b) => rank(a) - rank(b)).join('\n');
  return `${markdown.slice(0, start + START.length)}\n\n${HEAD}\n${table}\n\n${markdown.slice(end)}`;
}

/** How the table differs from this row; null if it agrees. The version is that of this machine, and does not count. */
export function otherThan(markdown: string, row: BrowserRow): string | null {
  const there = linesOf(markdown).find((text) => isOf(row.engine, text));
  if (there === undefined) return 'nothing';
  const version = there.split(' | ')[1] ?? '';
  return there === line({ ...row, version }) ? null : there;
}

function linesOf(markdown: string): string[] {
  const table = markdown.slice(markdown.indexOf(START), markdown.indexOf(END));
  return table
    .split('\n')
    .filter((text) => Object.values(NAMES).some((name) => text.startsWith(`| ${name} |`)));
}

const isOf = (engine: EngineName, text: string) => text.startsWith(`| ${NAMES[engine]} |`);

export function readReadme(): string {
  return readFileSync(README, 'utf8');
}

export function writeReadme(markdown: string): void {
  writeFileSync(README, markdown);
}
