import type { Schema } from '@posecast/wire';
import { expect, it } from 'vitest';
import { arrangeTraces, TRACES_A_PAGE } from '../../src/twin/plots/choice.ts';
import { History } from '../../src/twin/plots/history.ts';
import { traceReading } from '../../src/twin/plots/trace.ts';
import { schemaWith } from '../rigs/schema.ts';

const JOINTS = Array.from({ length: 12 }, (_, i) => `j${i}`);
const SCHEMA = schemaWith({ joint: JOINTS, power: ['main'], sonar: ['front', 'back'] }, [
  { name: 'ref', unit: 'rad', scale: 0.001, labels: 'joint' },
  { name: 'pos', unit: 'rad', scale: 0.001, labels: 'joint' },
  { name: 'cur', unit: 'A', scale: 0.01, labels: 'joint' },
  { name: 'volt', unit: 'V', scale: 0.05, labels: 'power' },
  { name: 'range', unit: 'm', scale: 0.01, labels: 'sonar' },
  { name: 'flags', bits: ['jam'], labels: 'joint' },
]);

/** Ten frames in which these channels move by this many steps. */
function past(moving: Readonly<Record<string, number>>, schema: Schema = SCHEMA): History {
  const history = new History();
  for (let n = 0; n < 10; n += 1) {
    const codes = new Int32Array(schema.size);
    for (const [channel, steps] of Object.entries(moving)) {
      const [name = '', label = ''] = channel.split('.');
      const field = schema.field(name)!;
      codes[field.start + field.labels.indexOf(label)] = n % 2 === 0 ? 0 : steps;
    }
    history.push(schema, { codes, atMs: n * 100 });
  }
  return history;
}

const named = (history: History) =>
  arrangeTraces(history, 1000).map(({ field, label }) => `${field} ${label}`);
const page = (history: History) => named(history).slice(0, TRACES_A_PAGE);

it('shows the joints that move most, in their own order, and two values of what moves beside them', () => {
  const moving = past({
    'pos.j9': 500,
    'pos.j2': 40,
    'pos.j5': 90,
    'pos.j7': 300,
    'cur.j2': 9,
    'cur.j9': 80,
  });
  expect(page(moving)).toEqual(['pos j2', 'pos j5', 'pos j7', 'pos j9', 'cur j2', 'cur j9']);
  expect(page(past({ 'range.back': 30 })).slice(4)).toEqual(['range back', 'pos j4']);
});

it('shows the first joints of a robot that stands still; noise is no motion', () => {
  const still = ['pos j0', 'pos j1', 'pos j2', 'pos j3', 'pos j4', 'pos j5'];
  expect(page(past({ 'cur.j3': 2 }))).toEqual(still);
});

it('reaches every number once, each of which can be plotted, and no bits', () => {
  const history = past({ 'pos.j9': 500, 'cur.j9': 80 });
  const all = named(history);
  expect(all).toHaveLength(3 * JOINTS.length + 3);
  expect(new Set(all).size).toBe(all.length);
  for (const trace of arrangeTraces(history, 1000)) expect(traceReading(SCHEMA, trace)).not.toBeNull();
  expect(all.at(-1)).toBe('range back');
  expect(all.indexOf('ref j0'), 'after all else of the joints').toBeGreaterThan(all.indexOf('cur j11'));
});

it('has nothing before the first frame, and sensors of a robot without joints', () => {
  expect(arrangeTraces(new History(), 0)).toEqual([]);
  const fields = [{ name: 'range', unit: 'm', scale: 0.01, labels: 'sonar' }];
  const schema = schemaWith({ sonar: ['a', 'b'] }, fields);
  expect(named(past({ 'range.b': 10 }, schema))).toEqual(['range a', 'range b']);
});
