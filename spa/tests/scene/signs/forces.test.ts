// @vitest-environment happy-dom
import { expect, it } from 'vitest';
import { OVERLAY_COLORS } from '../../../src/scene/signs/colors.ts';
import { Forces } from '../../../src/scene/signs/forces.ts';
import { AT } from '../../../src/scene/signs/strokes.ts';
import { drawnSign, legSchema, signFrame } from '../../rigs/signs.ts';

const GREY = OVERLAY_COLORS.dark.stale;

/** The leg's sensor in a picture, after its arrows have grown. */
function show(
  codes: Parameters<typeof signFrame>[0],
  given: Parameters<typeof signFrame>[1] = {},
  feet: readonly string[] = [],
) {
  const marks = feet.map((name) => ({ name }));
  const { sign, picture, strokes } = drawnSign(Forces, signFrame(codes, given), { feet: marks });
  const [red, green, blue] = [...picture.strokes.numbers.subarray(AT.tint, AT.tint + 3)].map((part) =>
    Math.round(part * 255),
  );
  const flange = (red! << 16) | (green! << 8) | blue!;
  return { ...sign.drawn[0]!, strokes, flange, labels: sign.labels(picture) };
}

const up = (fz: number | null) => ({ 'ftf.F.fz': fz });

it('arrows are as long as forces are large, and as the viewer wants them', () => {
  const one = show(up(100));
  expect(show(up(200)).force!.size).toBeCloseTo(2 * one.force!.size);
  expect(show(up(100), { settings: { arrowScale: 2 } }).force!.size).toBeCloseTo(2 * one.force!.size);
  expect(one.tip[2] - one.force!.size).toBeCloseTo(0.05, 6); // from the foot's link, which sits at 0.05 m
  expect(show(up(-100)).tip[2]).toBeLessThan(0.05);
});

it('moments sweep an arc as far as they are large, never a whole turn', () => {
  const sweep = (my: number) => show({ 'ftm.F.my': my * 100 }).moment!.size;
  expect(sweep(4)).toBeCloseTo(2 * sweep(2));
  expect(sweep(1000)).toBeLessThan(2 * Math.PI);
});

it('arrows have more heads the worse it is: colour is not the only sign', () => {
  const [ok, caution, fault] = [249, 251, 501].map((force) => show(up(force)));
  expect([ok!.force!.level, caution!.force!.level, fault!.force!.level]).toEqual(['ok', 'caution', 'fault']);
  expect([caution!.strokes, fault!.strokes]).toEqual([ok!.strokes + 1, ok!.strokes + 2]);
  expect(fault!.labels[0]).toMatchObject({ key: 'wrench-F', text: '501 N', level: 'fault' });
});

it('the sensor’s place is marked when there is nothing to show, and no arrow is where there is no reading', () => {
  expect(show(up(2)).strokes).toBe(1);
  const unread = show(up(null));
  expect(unread).toMatchObject({ strokes: 1, force: { value: null, size: 0 }, flange: GREY });
  expect(unread.labels).toMatchObject([{ text: 'foot: no reading', quiet: true }]);
  expect(show(up(null), { language: 'ko' }).labels[0]?.text).toBe('foot: 측정값 없음');
  expect(show({ ...up(501), 'ftf.F.fx': null }).flange, 'one axis reads, and is too much').not.toBe(GREY);
});

it('there is no ring where balance marks the foot, but one that reads nothing is marked', () => {
  expect(show(up(2), {}, ['LF', 'F']).strokes).toBe(0);
  expect(show(up(2), {}, ['another']).strokes).toBe(1);
  expect(show(up(null), {}, ['F']).strokes).toBe(1);
});

it('arrows glide to a new length within half a second, and come to rest', () => {
  const frame = signFrame(up(500));
  const sign = new Forces(frame.schema);
  sign.read(frame);
  let ticks = 0;
  while (sign.advance(1 / 60)) ticks += 1;
  expect(ticks).toBeGreaterThan(5);
  expect(ticks).toBeLessThan(60);
  expect(sign.advance(1 / 60)).toBe(false);
});

it('values are signed where one axis is measured, and sums where more are', () => {
  expect(show(up(-28), { schema: legSchema({ ftf: ['fz'] }) }).force!.value).toBe(-28);
  expect(show({ 'ftf.F.fx': 3, 'ftf.F.fz': 4 }).force!.value).toBe(5);
});

it('a moment is in the words when it is large, and explained then', () => {
  const [small, large] = [20, 400].map((my) => show({ ...up(100), 'ftm.F.my': my }).labels[0]);
  expect([small?.text, small?.explain]).toEqual(['100 N', ['signs.force', 'signs.levels']]);
  expect([large?.text, large?.explain]).toEqual([
    '100 N · 4.0 N·m',
    ['signs.force', 'signs.moment', 'signs.levels'],
  ]);
});
