// @vitest-environment happy-dom
import { parseSchema } from '@posecast/wire';
import { afterAll, beforeAll, expect, it } from 'vitest';
import { SensorView } from '../../src/app/numbers/sensors/Sensors.tsx';
import { JointCardView } from '../../src/app/numbers/table/joint_card_view.ts';
import { JointView } from '../../src/app/numbers/table/joint_view.ts';
import { HistoryKeeper } from '../../src/app/state/robot_link.ts';
import { en } from '../../src/app/text/en.ts';
import { moreEn } from '../../src/app/text/more_en.ts';
import { CsvTable } from '../../src/past/save/csv_file.ts';
import { NUMBERS } from '../../src/twin/joints.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { SensorTable } from '../../src/twin/sensors/sensors.ts';
import { codesWith, SCHEMA, SCHEMA_TEXT, stateOf } from '../rigs/schema.ts';

/** As a newcomer adds it: a row, and its words. */
const ACCELERATION = { name: 'acc', place: 8, wide: 'rate', yields: 'some' };
const WORDS = { acc: 'acc', accWhat: 'How fast the speed changes' };
const MORE_WORDS = { accName: 'acceleration', accMeans: 'How fast the speed of the joint changes.' };

beforeAll(() => {
  (NUMBERS as unknown as object[]).push(ACCELERATION);
  Object.assign(en, WORDS);
  Object.assign(moreEn, MORE_WORDS);
});
afterAll(() => {
  (NUMBERS as unknown as object[]).pop();
  for (const key of Object.keys(WORDS)) Reflect.deleteProperty(en, key);
  for (const key of Object.keys(MORE_WORDS)) Reflect.deleteProperty(moreEn, key);
});

it('a number that has a row is a column, a line of the card and a column of the CSV, and no sensor', () => {
  const doc = JSON.parse(SCHEMA_TEXT);
  doc.fields.push({ name: 'acc', unit: 'rad/s2', scale: 0.01, labels: 'joint' });
  const schema = parseSchema(JSON.stringify(doc));
  const twin = new RobotTwin('small', 0);
  const minute = new HistoryKeeper(twin);
  twin.acceptSchema(schema);
  const codes = new Int32Array(schema.size);
  codes[schema.field('acc')!.start + 1] = 25;
  twin.acceptState(stateOf(codes, { schemaId: schema.id }));
  const [table, card] = [document.createElement('div'), document.createElement('div')];
  new JointView(table, twin).write(0);
  new JointCardView(card, { twin, minute, coming: null }, 'RKN').write(0);
  const heads = [...table.querySelectorAll('thead th')].map(({ textContent }) => textContent);
  expect(heads.at(-4)).toMatch(/^accrad\/s/);
  expect(table.querySelector('td[data-field="acc"][data-label="RKN"]')?.textContent).toBe('0.25');
  expect(card.querySelector('dl')?.textContent).toMatch(
    /acceleration.*speed of the joint changes\. *0\.25rad\/s2/,
  );
  expect(new CsvTable([schema], []).head).toContain('acc.RKN [rad/s2]');
  expect(new SensorTable(schema).groups.map(({ title }) => title)).not.toContain('acc');
});

it('the sensor table shows every group with its units', () => {
  const twin = new RobotTwin('small', 0);
  twin.acceptSchema(SCHEMA);
  const host = document.createElement('div');
  const view = new SensorView(host, twin);
  twin.acceptState(stateOf(codesWith({ 'ftf.RF.fz': 260, 'ftm.RF.mx': null }), { seq: 9 }));
  view.write(0);
  const row = host.querySelector('[data-field="ftf"][data-label="RF.fz"]')?.closest('tr');
  expect(row?.textContent).toBe('Fz260.0N');
  expect(row?.dataset.level).toBe('caution');
  expect(host.querySelector('[data-label="RF.mx"]')?.textContent).toBe('—');
  expect(host.querySelector<HTMLElement>('.sensors')?.dataset.seq).toBe('9');
  expect([...host.querySelectorAll('caption')].map((c) => c.firstChild?.textContent)).toEqual([
    'right foot',
    'torso',
    'Power',
    'range',
  ]);
});
