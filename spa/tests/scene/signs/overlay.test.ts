// @vitest-environment happy-dom
import { expect, it } from 'vitest';
import { Facets } from '../../../src/scene/signs/balance/shapes.ts';
import type { BalancePicture, ShownBalance } from '../../../src/scene/signs/balance_drawing.ts';
import { OVERLAY_COLORS } from '../../../src/scene/signs/colors.ts';
import { Overlay } from '../../../src/scene/signs/overlay.ts';
import type { OverlayStyle } from '../../../src/scene/signs/robot_overlay.ts';
import type { BalanceReadings } from '../../../src/twin/overlay/reader.ts';
import type { Wrench } from '../../../src/twin/sensors/wrenches.ts';
import { sampleLeg } from '../../rigs/leg_sample.ts';

const MANNER: OverlayStyle = {
  live: true,
  from: 'pos',
  arrowScale: 1,
  palette: 'standard',
  angle: 'rad',
  words: {
    offBy: (channel, by) => `${channel} ${by} off`,
    compliant: (channel) => `${channel} compliant`,
    withoutReading: (name) => `${name}: no reading`,
  },
};

function standing(force: number, level: 'ok' | 'fault') {
  const mount = { kind: 'wrench', name: 'foot', link: 'foot', xyz: [0, 0, 0], rpy: [0, 0, 0] } as const;
  const wrench: Wrench = {
    ...{ site: 'F', name: 'foot', mount },
    force: { vector: [0, 0, force], level, axes: [2], much: 500 },
    moment: { vector: [0, 0, 0], level: 'ok', axes: [], much: 10 },
  };
  return {
    wrenches: [wrench],
    deviations: [],
    imus: [],
    body: null,
    based: true,
    loads: null,
    balance: null,
  };
}

function board() {
  const host = document.createElement('div');
  const made = new Overlay(host, OVERLAY_COLORS.dark);
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
  const bearer = { figure: sampleLeg() };
  expect(made.make()).toBe(false);
  made.show(bearer, standing(300, 'ok'), MANNER);
  expect(made.make(), 'a flange, a plane').toBe(true);
  settle(made);
  expect(made.make()).toBe(false);
  made.show(bearer, standing(300, 'ok'), MANNER);
  expect(made.make(), 'the same again').toBe(false);
  made.show(bearer, standing(300, 'ok'), { ...MANNER, live: false });
  expect(words()[0]?.dataset.old).toBe('false');
  expect(made.make(), 'grey now').toBe(true);
  expect(words()[0]?.dataset.old).toBe('true');
  made.show(bearer, null);
  expect(made.make()).toBe(true);
  expect(made.strokes.count).toBe(0);
});

it('the signs of balance stand alone under the robot, without the plane of what is level', () => {
  const facets = new Facets();
  let floorM: number | null = 0;
  const picture: BalancePicture = {
    facets,
    begin: () => facets.begin(),
    end: () => facets.end(),
    addRobot: () => ({
      get shown() {
        return { floorM, feet: [] } as unknown as ShownBalance;
      },
      draw: () => {},
      labels: () => [],
    }),
  };
  const { made } = board();
  const bearer = { figure: sampleLeg() };
  made.show(bearer, standing(300, 'ok'), MANNER);
  settle(made);
  const alone = made.strokes.count;
  const balance = {} as BalanceReadings;
  made.show(bearer, { ...standing(300, 'ok'), balance }, { ...MANNER, balance: () => picture });
  settle(made);
  expect(alone - made.strokes.count).toBe(6); // fan, rim and four ticks
  floorM = null;
  made.moved();
  settle(made);
  expect(made.strokes.count, 'nothing tells what it stands on').toBe(alone);
});

it('of several robots: strokes of all, words of the worst first, nobody’s lean', () => {
  const { made, words, level } = board();
  const [well, badly] = [{ figure: sampleLeg() }, { figure: sampleLeg() }];
  made.show(well, standing(200, 'ok'), MANNER);
  settle(made);
  const alone = made.strokes.count;
  expect(words().map(({ dataset }) => dataset.sign)).toEqual(['wrench-F']);
  made.show(badly, standing(450, 'fault'), MANNER);
  settle(made);
  expect(made.strokes.count).toBe(2 * alone + 2); // two more heads
  expect(words().find(({ dataset }) => dataset.level === 'fault')?.textContent).toBe('450 N');
  expect(new Set(words().map(({ dataset }) => dataset.sign))).toEqual(new Set(['0-wrench-F', '1-wrench-F']));
  expect(level().hidden).toBe(true);
});

it('a robot without a body yet has no strokes, and words nowhere', () => {
  const { made, words } = board();
  made.show({ figure: null }, standing(450, 'fault'), MANNER);
  expect(made.make()).toBe(false);
  expect(words()).toEqual([]);
});

it('words go where their points are; behind the eye they are hidden', () => {
  const { made, words } = board();
  made.show({ figure: sampleLeg() }, standing(450, 'fault'), MANNER);
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
  made.show({ figure: sampleLeg() }, standing(450, 'fault'), MANNER);
  settle(made);
  made.placeLabels(() => ({ x: 150, y: 50 }), { width: 400, height: 300, top: 0, free: 300 });
  const [x = 0, y = 0] = (words()[0]!.style.transform.match(/-?\d+/g) ?? []).map(Number);
  expect(x >= 260 || x <= 40 || y >= 80 || y <= 1, `at ${x}, ${y}`).toBe(true);
});

it('a label that its level hides has no line to its point any more', () => {
  const { made, words } = board();
  const bearer = { figure: sampleLeg() };
  made.show(bearer, standing(450, 'fault'), MANNER);
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
  made.show(bearer, standing(450, 'ok'), MANNER);
  settle(made);
  made.placeLabels(() => ({ x: 150, y: 50 }), room);
  expect(words()[0], 'the same').toBe(label);
  expect(label!.textContent).toBe('450 N');
  expect(label!.hidden, 'and so is its line').toBe(true);
});
