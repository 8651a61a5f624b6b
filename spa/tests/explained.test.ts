// @vitest-environment happy-dom
import { parseSchema } from '@posecast/wire';
import { afterEach, expect, it } from 'vitest';
import { explain, explainFlags, keysOfLabel, labelUnder, placeOf } from '../src/app/explain/asked.ts';
import { explainedBy } from '../src/app/explain/catalogue.ts';
import en from '../src/app/explain/en.json';
import { createTerm, createUnit } from '../src/app/explain/term.ts';
import { drawnLines } from '../src/browser/drawn_lines.ts';
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

it('a label on the body is found under a tap, not at the end of a drag', () => {
  const label = document.createElement('div');
  label.className = 'sign-label';
  label.dataset.sign = 'apart-RKN';
  label.getBoundingClientRect = () => new DOMRect(100, 100, 80, 20);
  document.body.append(label);
  expect(labelUnder({ x: 120, y: 110 }, { x: 122, y: 110 })).toBe(label);
  expect(labelUnder({ x: 10, y: 110 }, { x: 122, y: 110 })).toBeNull();
  expect(labelUnder({ x: 10, y: 10 }, { x: 10, y: 10 })).toBeNull();
  expect(keysOfLabel(label)).toEqual(['signs.ghost']);
  label.dataset.quiet = 'true';
  expect(keysOfLabel(label)).toEqual(['signs.yields']);
  label.dataset.sign = 'wrench-RF';
  expect(keysOfLabel(label)).toEqual(['signs.force', 'signs.levels']);
  label.textContent = '213 N · 5.3 N·m';
  expect(keysOfLabel(label)).toEqual(['signs.force', 'signs.moment', 'signs.levels']);
});

it('an arrow explains itself under a tap, also where its label finds no room', () => {
  const picture = document.createElement('div');
  picture.getBoundingClientRect = () => new DOMRect(50, 20, 300, 300);
  const [near, far] = ['wrench-LF', 'wrench-RF'].map((sign) => {
    const label = document.createElement('div');
    label.className = 'sign-label';
    label.hidden = true;
    label.dataset.sign = sign;
    picture.append(label);
    return label;
  });
  document.body.replaceChildren(picture);
  drawnLines.set(near!, [
    [
      { x: 100, y: 100 },
      { x: 100, y: 40 },
    ],
  ]);
  drawnLines.set(far!, [
    [
      { x: 112, y: 100 },
      { x: 112, y: 40 },
    ],
  ]);
  const tap = (x: number, y: number) => labelUnder({ x, y }, { x, y });
  expect(tap(154, 90)).toBe(near);
  expect(tap(160, 90)).toBe(far);
  expect(tap(150, 49)).toBeNull(); // beyond its tip
  expect(tap(139, 90)).toBeNull();
  far!.dataset.sign = 'apart-RKN'; // it lies on its joint, which the tap chooses
  expect(tap(163, 90)).toBeNull();
  expect(tap(160, 90)).toBe(near);
  expect(tap(0, 0)).toBeNull();
  expect(placeOf(near!, new MouseEvent('click', { clientX: 154, clientY: 90 }))).toMatchObject({ left: 154 });
});
