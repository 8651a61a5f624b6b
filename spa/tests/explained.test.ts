// @vitest-environment happy-dom
import { parseSchema } from '@posecast/wire';
import { afterEach, expect, it } from 'vitest';
import { explain, explainFlags, keyOfLabel, labelUnder } from '../src/app/explain/asked.ts';
import { explainedBy } from '../src/app/explain/catalogue.ts';
import en from '../src/app/explain/en.json';
import { createTerm, createUnit } from '../src/app/explain/term.ts';
import formatSource from '../src/twin/format.ts?raw';
import { NUMBERS } from '../src/twin/joints.ts';
import { RobotTwin } from '../src/twin/robot.ts';
import { SCHEMA_TEXT } from './schema.ts';

afterEach(() => document.body.replaceChildren());

function robot(explainBits: object = {}): RobotTwin {
  const doc = JSON.parse(SCHEMA_TEXT);
  const twin = new RobotTwin('small', 0);
  twin.acceptSchema(
    parseSchema(JSON.stringify({ ...doc, mapping: { ...doc.mapping, explain: { flags: explainBits } } })),
  );
  return twin;
}
const flag = (bit: string, source = 'RKN') => {
  const term = createTerm(bit, 'flag');
  Object.assign(term.dataset, { bit, source });
  return term;
};

it('every column, unit and word that the page shows is in the catalogue', () => {
  for (const name of [...NUMBERS, 'joint', 'homed', 'enabled', 'flags'])
    expect(explainedBy(en, `columns.${name}`), name).not.toBeNull();
  const units = formatSource.matchAll(/unit: '([^']+)'/g);
  for (const [, unit] of units) expect(explainedBy(en, `units.${unit}`), unit).not.toBeNull();
  for (const kind of ['wrench', 'imu', 'power', 'other'])
    expect(explainedBy(en, `sensors.${kind}`), kind).not.toBeNull();
  expect(['__proto__', 'units.constructor', 'units', 'x.y'].map((key) => explainedBy(en, key))).toEqual([
    null,
    null,
    null,
    null,
  ]);
});

it('a column is explained with its unit; a unit that nobody knows by what it is', () => {
  const head = document.createElement('th');
  const unit = createUnit();
  unit.textContent = 'rad';
  head.append(createTerm('pos', 'columns.pos'), unit);
  expect(explain(head.querySelector('button')!, en, robot()).map(({ name }) => name)).toEqual(['pos', 'rad']);
  unit.textContent = 'furlong';
  expect(explain(unit, en, robot())).toEqual([{ ...en.sensors.other, name: 'furlong' }]);
});

it('a flag by the profile, else by what a flag is; what comes from outside is made visible', () => {
  const twin = robot({
    jam: { en: { say: '{joint} is blocked[: {error} off].', why: 'It hit \u202esomething.' } },
  });
  expect(explain(flag('jam'), en, twin)).toEqual([
    { name: 'jam', what: 'Right knee is blocked.', how: 'It hit \\u{202e}something.' },
  ]);
  expect(explain(flag('pwmSaturated'), en, twin)).toEqual([{ ...en.words.flag, name: 'PWM saturated' }]);
  expect(explain(flag('jam', 'nobody'), en, twin)[0]?.what).toBe(en.words.flag.what);
  expect(explainFlags(twin).map(([bit, { what }]) => [bit, what])).toEqual([
    ['jam', 'The joint is blocked.'],
  ]);
});

it('a label on the body is found under a tap, not at the end of a drag', () => {
  const label = document.createElement('div');
  label.className = 'sign-label';
  label.dataset.sign = 'apart-RKN';
  label.getBoundingClientRect = () => new DOMRect(100, 100, 80, 20);
  document.body.append(label);
  const at = (x: number, y: number) => new MouseEvent('click', { clientX: x, clientY: y });
  expect(labelUnder({ x: 120, y: 110 }, at(122, 110))).toBe(label);
  expect(labelUnder({ x: 10, y: 110 }, at(122, 110))).toBeNull();
  expect(labelUnder({ x: 10, y: 10 }, at(10, 10))).toBeNull();
  expect(keyOfLabel(label)).toBe('signs.ghost');
  label.dataset.quiet = 'true';
  expect(keyOfLabel(label)).toBe('signs.yields');
  label.dataset.sign = 'wrench-RF';
  expect(keyOfLabel(label)).toBe('signs.force');
});
