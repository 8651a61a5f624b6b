// @vitest-environment happy-dom
import { parseSchema } from '@posecast/wire';
import { afterEach, expect, it } from 'vitest';
import { explain, explainedBy, explainFlags, keysOfLabel, placeOf } from '../../src/app/explain/catalogue.ts';
import en from '../../src/app/explain/en.json';
import ko from '../../src/app/explain/ko.json';
import { createTerm, createUnit } from '../../src/app/explain/terms.tsx';
import formatSource from '../../src/twin/format.ts?raw';
import { NUMBERS } from '../../src/twin/joints.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { SCHEMA_TEXT } from '../rigs/schema.ts';

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
  for (const name of [...NUMBERS.map(({ name }) => name), 'joint', 'homed', 'enabled', 'flags'])
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

it('what is drawn on the time line, all of it at once', () => {
  const names = explain(createTerm('?', 'timeLine'), en, robot()).map(({ name }) => name);
  expect(names).toEqual(Object.values(en.timeLine).map(({ name }) => name));
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

it('a label is about what its sign says', () => {
  const label = document.createElement('div');
  expect(keysOfLabel(label)).toEqual([]);
  label.dataset.explains = 'signs.force signs.levels';
  expect(keysOfLabel(label)).toEqual(['signs.force', 'signs.levels']);
  label.hidden = true;
  label.getBoundingClientRect = () => new DOMRect();
  expect(placeOf(label, new MouseEvent('click', { clientX: 154, clientY: 90 }))).toMatchObject({ left: 154 });
});

it('what is said of an arrow tells what its colours mean, in its first paragraph', () => {
  expect(en.signs.force.what).toMatch(/green.*yellow.*red/i);
  expect(ko.signs.force.what).toMatch(/초록.*노랑.*빨강/);
});
