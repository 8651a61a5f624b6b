// @vitest-environment happy-dom
import { expect, it } from 'vitest';
import { Attitude } from '../../../src/scene/signs/attitude.ts';
import { OVERLAY_COLORS } from '../../../src/scene/signs/colors.ts';
import { Forces } from '../../../src/scene/signs/forces.ts';
import { Load } from '../../../src/scene/signs/load.ts';
import { Overlay } from '../../../src/scene/signs/overlay.ts';
import { RobotSigns } from '../../../src/scene/signs/signs.ts';
import { sampleLeg } from '../../rigs/leg_sample.ts';
import { legSchema, signFrame } from '../../rigs/signs.ts';

const SCHEMA = legSchema({ ftf: ['fz'], base: true });

/** A frame of the leg with this upward force on its foot, N. */
const standing = (force: number, given: Parameters<typeof signFrame>[1] = {}) =>
  signFrame({ 'ftf.F.fz': force, 'baseq.base.w': 1e6 }, { schema: SCHEMA, ...given });

/** A robot in a picture, with its body or none. */
class Bearer {
  readonly signs = new RobotSigns([Forces, Attitude, Load]);

  constructor(
    readonly made: Overlay,
    readonly figure: ReturnType<typeof sampleLeg> | null = sampleLeg(),
  ) {}

  show(...frame: Parameters<typeof standing>): void {
    this.signs.read(standing(...frame));
    this.made.show(this, this.signs);
  }
}

function board(facets = false) {
  const host = document.createElement('div');
  const made = new Overlay(host, OVERLAY_COLORS.dark, facets);
  const words = () => [...host.querySelectorAll<HTMLElement>('.sign-label')];
  return { made, words, level: () => host.querySelector<HTMLElement>('.stage-level')! };
}

/** Lets arrows grow to their full length. */
function settle(made: Overlay): void {
  while (made.advance(1 / 30)) made.make();
  made.make();
}

it('makes a picture when there is news, and only then', () => {
  const { made, words } = board();
  const robot = new Bearer(made);
  expect(made.make()).toBe(false);
  robot.show(240);
  expect(made.make(), 'a flange, a plane').toBe(true);
  settle(made);
  expect(made.make()).toBe(false);
  robot.show(240);
  expect(made.make(), 'the same again').toBe(false);
  robot.show(240, { live: false });
  expect(words()[0]?.dataset.old).toBe('false');
  expect(made.make(), 'grey now').toBe(true);
  expect(words()[0]?.dataset.old).toBe('true');
  robot.signs.read(null);
  made.show(robot, robot.signs);
  expect(made.make()).toBe(true);
  expect(made.strokes.count).toBe(0);
});

it('of several robots: strokes of all, words of the worst first, nobody’s lean', () => {
  const { made, words, level } = board();
  new Bearer(made).show(200);
  settle(made);
  const alone = made.strokes.count;
  expect(words().map(({ dataset }) => dataset.sign)).toEqual(['wrench-F']);
  new Bearer(made).show(550);
  settle(made);
  expect(made.strokes.count).toBe(2 * alone + 2); // two more heads
  expect(words().find(({ dataset }) => dataset.level === 'fault')?.textContent).toBe('550 N');
  expect(new Set(words().map(({ dataset }) => dataset.sign))).toEqual(new Set(['0-wrench-F', '1-wrench-F']));
  expect(level().hidden).toBe(true);
});

it('a robot without a body yet has no strokes, and words nowhere', () => {
  const { made, words } = board();
  new Bearer(made, null).show(550);
  expect(made.make()).toBe(false);
  expect(words()).toEqual([]);
});

it('a body has the colours of its load until that is off; another body has its own', () => {
  const { made } = board();
  const robot = new Bearer(made);
  const tints = new Map<string, unknown>();
  robot.figure!.setTint = (link, tint) => void tints.set(link, tint);
  robot.show(0, { settings: { load: 'temp', forces: false, level: false } });
  expect(made.make()).toBe(true);
  expect(tints.get('shank')).toMatchObject({ hatched: false });
  robot.show(0, { settings: { load: 'temp', forces: false, level: false } });
  expect(made.make(), 'the same again').toBe(false);
  robot.show(0, { settings: { forces: false, level: false } });
  expect(made.make()).toBe(true);
  expect(new Set(tints.values())).toEqual(new Set([null]));
});

it('words go where their points are; behind the eye they are hidden', () => {
  const { made, words } = board();
  new Bearer(made).show(550);
  settle(made);
  const room = { width: 400, height: 300, top: 0, free: 300 };
  made.placeLabels(([x]) => ({ x: 100 + x, y: 50 }), room);
  expect(words()[0]!.hidden).toBe(false);
  expect(words()[0]!.style.transform).toContain('px');
  made.placeLabels(() => ({ x: 500, y: 50 }), room);
  expect(words()[0]!.hidden, 'outside the picture').toBe(true);
  made.placeLabels(() => null, room);
  expect(words()[0]!.hidden).toBe(true);
});

it('words cover neither roll nor pitch', () => {
  const { made, words, level } = board();
  level().getBoundingClientRect = () => new DOMRect(100, 20, 160, 60);
  new Bearer(made).show(550);
  settle(made);
  made.placeLabels(() => ({ x: 150, y: 50 }), { width: 400, height: 300, top: 0, free: 300 });
  const [x = 0, y = 0] = (words()[0]!.style.transform.match(/-?\d+/g) ?? []).map(Number);
  expect(x >= 260 || x <= 40 || y >= 80 || y <= 1, `at ${x}, ${y}`).toBe(true);
});

it('a label that its level hides has no line to its point any more', () => {
  const { made, words } = board();
  const robot = new Bearer(made);
  robot.show(550);
  settle(made);
  const [label] = words();
  // as on a phone, where values within their limits need no label
  const isShown = () => label!.dataset.level !== 'ok';
  Object.defineProperty(label, 'offsetWidth', { get: () => (isShown() ? 60 : 0) });
  Object.defineProperty(label, 'offsetHeight', { get: () => (isShown() ? 19 : 0) });
  Object.defineProperty(label!.parentElement, 'offsetWidth', { get: () => 400 });
  const room = { width: 400, height: 300, top: 0, free: 300 };
  made.placeLabels(() => ({ x: 150, y: 50 }), room);
  expect(label!.hidden).toBe(false);
  robot.show(110);
  settle(made);
  made.placeLabels(() => ({ x: 150, y: 50 }), room);
  expect(words()[0], 'the same').toBe(label);
  expect(label!.textContent).toBe('110 N');
  expect(label!.hidden, 'and so is its line').toBe(true);
});
