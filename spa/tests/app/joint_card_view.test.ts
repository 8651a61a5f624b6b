// @vitest-environment happy-dom
import { expect, it } from 'vitest';
import { JointCardView } from '../../src/app/numbers/table/joint_card_view.ts';
import { HistoryKeeper } from '../../src/app/state/robot_link.ts';
import type { PastState } from '../../src/past/past_types.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { schemaOf } from '../rigs/past_recordings.ts';

const SCHEMA = schemaOf(1);
const AT_MS = 100_000;

function stateAt(atMs: number): PastState {
  const codes = Int32Array.of(atMs / 100);
  return { schemaId: SCHEMA.id, seq: atMs / 100, tS: atMs / 1000, codes, atMs, lateMs: 0 };
}

function cardOf(coming: (() => readonly PastState[]) | null): HTMLElement {
  const twin = new RobotTwin('r', 0);
  const minute = new HistoryKeeper(twin);
  twin.acceptSchema(SCHEMA);
  for (let atMs = AT_MS - 60_000; atMs <= AT_MS; atMs += 1000)
    twin.acceptState({ ...stateAt(atMs), freshMs: null, bornMs: null, changedMs: atMs });
  const host = document.createElement('div');
  new JointCardView(host, { twin, minute, coming }, 'J0').write(AT_MS);
  return host;
}

/** The start and end of a path, in a width of 300. */
function reach(card: HTMLElement, selector: string): number[] {
  const path = card.querySelector(selector)?.getAttribute('d') ?? '';
  const xs = [...path.matchAll(/[ML]([\d.]+)/g)].map(([, x]) => Number(x));
  return [xs[0]!, xs.at(-1)!];
}

it('live, a strip is the last minute and nothing else', () => {
  const card = cardOf(null);
  expect(reach(card, '.trace-pos')).toEqual([0, 300]);
  expect(card.querySelectorAll('.trace-later, .strip-moment, .strip-after')).toHaveLength(0);
  expect(card.querySelector('figcaption')?.textContent).toMatch(/last 60 s$/);
});

it('in the past a strip is the minute around, and what comes after the moment is drawn apart', () => {
  const coming = Array.from({ length: 40 }, (_, i) => stateAt(AT_MS + 1000 * (i + 1)));
  const card = cardOf(() => coming);
  expect(reach(card, '.trace-pos:not(.trace-later)')).toEqual([0, 150]);
  expect(reach(card, '.trace-later')).toEqual([155, 300]);
  expect(card.querySelector('.strip-moment')?.getAttribute('d')).toMatch(/^M150 /);
  expect(card.querySelector('figcaption')?.textContent).toMatch(/30 s before and after$/);
  expect(card.querySelector('.strip-after')?.textContent).toBe('later');
});
