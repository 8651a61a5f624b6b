// @vitest-environment happy-dom
import { parseSchema } from '@posecast/wire';
import { afterAll, beforeAll, beforeEach, describe, expect, it, vi } from 'vitest';
import type { PlotManner, PlotStack as Stack } from '../../src/app/numbers/plots/plot_stack.ts';
import { moreEn } from '../../src/app/text/more_en.ts';
import { History } from '../../src/twin/plots/history.ts';
import type { Trace } from '../../src/twin/plots/trace.ts';
import { codesWith, SCHEMA, stateOf } from '../rigs/schema.ts';

/** Browser tests check the pictures: nothing is drawn here. */
const pen = new Proxy(
  {},
  { get: (_, name) => (name === 'measureText' ? () => ({ width: 7 }) : () => pen), set: () => true },
);
let PlotStack: typeof Stack;

beforeAll(async () => {
  // WebKitGTK's in the C locale, for which uPlot would create a number format while loading
  Object.defineProperty(navigator, 'language', { value: 'C', configurable: true });
  vi.spyOn(HTMLCanvasElement.prototype, 'getContext').mockReturnValue(pen as never);
  vi.stubGlobal(
    'Path2D',
    class {
      moveTo() {}
      lineTo() {}
      rect() {}
      arc() {}
      closePath() {}
    },
  );
  ({ PlotStack } = await import('../../src/app/numbers/plots/plot_stack.ts'));
});
afterAll(() => vi.unstubAllGlobals());
beforeEach(() => document.body.replaceChildren());

const state = (atMs: number, changed: Parameters<typeof codesWith>[0] = {}) =>
  stateOf(codesWith(changed), { atMs });

function stack(list: readonly Trace[], manner: Partial<PlotManner> = {}) {
  const host = document.createElement('div');
  document.body.append(host);
  const made = new PlotStack(host, list, {
    ...{ theme: 'dark', angle: 'rad', derived: null, remove: () => {}, zoomed: () => {}, words: moreEn },
    ...manner,
  });
  const legend = () =>
    [...host.querySelectorAll('li')].map((entry) => entry.textContent?.replaceAll('\u2007', ' '));
  return { host, made, legend };
}

const LIST = [
  { field: 'pos', label: 'RKN' },
  { field: 'cur', label: 'RKN' },
  { field: 'error', label: 'RKN' },
];

describe('plots under one another', () => {
  it('wrap their names between words alone, and show them whole by a tap', () => {
    const { host, made } = stack([{ field: 'pos', label: 'left_hip_pitchJoint' }]);
    made.write(new History(), 2000);
    const name = host.querySelector<HTMLElement>('.plot-name')!;
    const words = [...name.childNodes].flatMap((node) => (node instanceof Text ? [node.data] : []));
    expect(words).toEqual(['left_', 'hip_', 'pitch', 'Joint pos']);
    expect(name.title).toBe('left_hip_pitchJoint pos');
    name.click();
    expect(name.hasAttribute('data-whole')).toBe(true);
  });

  it('tell apart long names that do not fit, as the table does', () => {
    const labels = [
      'می\u200cروم زانو',
      ...['2', '3'].map((v) => `${'arm_shoulder_pitch_actuator_'.repeat(3)}v${v}`),
    ];
    // four lines of 20 letters
    const box = { clientWidth: 140, clientHeight: 80, scrollWidth: 140 };
    const mocks = Object.entries(box).map(([name, px]) =>
      vi.spyOn(HTMLElement.prototype, name as 'clientWidth', 'get').mockReturnValue(px),
    );
    const height = vi.spyOn(HTMLElement.prototype, 'scrollHeight', 'get');
    mocks.push(
      height.mockImplementation(function (this: HTMLElement) {
        return (this.textContent?.length ?? 0) > 80 ? 100 : 80;
      }),
    );
    const { host, made } = stack(labels.map((label) => ({ field: 'pos', label })));
    made.write(new History(), 2000);
    const names = [...host.querySelectorAll<HTMLElement>('.plot-name')];
    const shown = () => names.map(({ textContent }) => textContent!);
    expect(shown()[0]).toBe('\u2068می\u200cروم زانو\u2069 pos');
    expect(shown()[1]).toMatch(/^.{1,36}…_v2 pos$/);
    expect(shown()[2]).toMatch(/^.{1,36}…_v3 pos$/);
    expect(names[1]!.title).toBe(`${labels[1]} pos`);
    names[1]!.click();
    expect(shown()[1]).toBe(`${labels[1]} pos`);
    for (const mock of mocks) mock.mockRestore();
  });

  it('are one for each unit, with the newest values beside the names', () => {
    const past = new History();
    for (let n = 0; n < 20; n += 1) past.push(SCHEMA, state(n * 100, { 'pos.RKN': n * 10, 'cur.RKN': 50 }));
    const { host, made, legend } = stack(LIST);
    made.write(past, 2000);
    expect(host.querySelectorAll('.uplot')).toHaveLength(2);
    expect(legend()).toEqual(['RKN pos 0.190rad×', 'RKN error−0.190rad×', 'RKN cur 0.50A×']);
    past.push(SCHEMA, state(2100, { 'pos.RKN': 500, 'cur.RKN': null }));
    made.write(past, 2100);
    expect(legend()).toEqual(['RKN pos 0.500rad×', 'RKN error−0.500rad×', 'RKN cur—A×']);
    made.dispose();
    expect(host.childElementCount).toBe(0);
  });

  it('are in degrees when degrees are shown, also as a table', () => {
    const past = new History();
    past.push(SCHEMA, state(1000, { 'pos.RKN': 1571 }));
    const { made, legend } = stack(LIST.slice(0, 1), { angle: 'deg' });
    made.write(past, 1000);
    expect(legend()).toEqual(['RKN pos 90.0°×']);
    expect(made.csv()).toBe('"time","RKN pos [°]"\r\n1970-01-01T00:00:01.000Z,90.0116696\r\n');
  });

  it('take what they show away by a button', () => {
    const remove = vi.fn();
    const { host, made } = stack(LIST, { remove });
    made.write(new History(), 0);
    host.querySelectorAll('button')[1]?.click();
    expect(remove).toHaveBeenCalledWith(LIST[1]);
  });

  it('stand while there is nothing, and while a robot comes back as another', () => {
    const past = new History();
    const { host, made, legend } = stack(LIST);
    made.write(past, 0);
    expect(legend().every((text) => text?.includes('not reported now'))).toBe(true);
    past.push(SCHEMA, state(100, { 'pos.RKN': 100 }));
    made.write(past, 100);
    expect(legend()[0]).toBe('RKN pos 0.100rad×');
    const odd = '<img src=x onerror=alert(1)>';
    const other = parseSchema(SCHEMA.text.replaceAll('"RKN"', JSON.stringify(odd)));
    past.push(other, { ...state(200), schemaId: other.id });
    made.write(past, 200);
    expect(legend()[0]).toContain('not reported now');
    const { made: hostile, host: page } = stack([{ field: 'pos', label: odd }]);
    hostile.write(past, 200);
    expect(page.querySelector('img')).toBeNull();
    expect(page.querySelector('.plot-name')?.textContent).toBe(`${odd} pos`);
    expect(host.querySelectorAll('.uplot')).toHaveLength(1);
  });

  it('hold no more after an hour than after a minute', () => {
    const past = new History();
    const { host, made } = stack(LIST);
    const hour = (from: number, frames: number) => {
      for (let n = from; n < from + frames; n += 1) {
        past.push(SCHEMA, state(n * 100, { 'pos.RKN': n % 300 }));
        if (n % 50 === 0) made.write(past, n * 100);
      }
    };
    hour(0, 700);
    const [nodes, rows] = [host.querySelectorAll('*').length, made.csv().split('\r\n').length];
    hour(700, 5000);
    expect(host.querySelectorAll('*').length).toBe(nodes);
    expect(made.csv().split('\r\n').length).toBeLessThanOrEqual(rows + 1);
  });
});
