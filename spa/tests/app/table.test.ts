// @vitest-environment happy-dom
import { parseSchema } from '@posecast/wire';
import { beforeEach, describe, expect, it } from 'vitest';
import { SensorView } from '../../src/app/numbers/sensors/Sensors.tsx';
import { JointView } from '../../src/app/numbers/table/joint_view.ts';
import { changeSettings } from '../../src/app/state/settings.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { codesWith, SCHEMA } from '../rigs/schema.ts';

const JAM = 4;

function show(twin: RobotTwin, seq: number, changed: Parameters<typeof codesWith>[0] = {}): void {
  const codes = codesWith(changed);
  twin.acceptState({
    schemaId: SCHEMA.id,
    seq,
    tS: seq / 30,
    codes,
    freshMs: 0,
    bornMs: 0,
    changedMs: 0,
    atMs: 0,
  });
}

function twinOf(): RobotTwin {
  const twin = new RobotTwin('small', 0);
  twin.acceptSchema(SCHEMA);
  return twin;
}

beforeEach(() => changeSettings({ angle: 'rad', faultsFirst: true }));

describe('joint table', () => {
  const cell = (host: HTMLElement, field: string, label: string) =>
    host.querySelector(`[data-field="${field}"][data-label="${label}"]`)?.textContent;
  const order = (host: HTMLElement) => [...host.querySelectorAll('tbody th')].map((th) => th.textContent);

  it('shows what the robot reports, and the number of the frame it shows', () => {
    const twin = twinOf();
    const host = document.createElement('div');
    const view = new JointView(host, twin);
    show(twin, 7, { 'ref.RKN': 500, 'pos.RKN': -480, 'temp.RKN': null, 'flags.RKN': 1 });
    view.write(0);
    expect(host.querySelector('table')?.dataset.seq).toBe('7');
    expect(cell(host, 'ref', 'RKN')).toBe('0.500');
    expect(cell(host, 'pos', 'RKN')).toBe('\u22120.480');
    expect(cell(host, 'error', 'RKN')).toBe('0.980');
    expect(cell(host, 'temp', 'RKN')).toBe('—');
    expect(cell(host, 'homed', 'RKN')).toBe('✓');
    expect(cell(host, 'enabled', 'RKN')).toBe('no');
  });

  it('stands with its rows before the first frame has come', () => {
    const host = document.createElement('div');
    new JointView(host, twinOf()).write(0);
    expect(order(host)).toEqual(['LKN', 'RKN', 'NK1']);
    expect(host.querySelector('table')?.dataset.seq).toBeUndefined();
  });

  it('marks a faulty row, brings it to the top, and leaves it there for a while', () => {
    const twin = twinOf();
    const host = document.createElement('div');
    const view = new JointView(host, twin);
    show(twin, 1, { 'flags.NK1': JAM });
    view.write(0);
    expect(order(host)).toEqual(['NK1', 'LKN', 'RKN']);
    expect(host.querySelector('tbody tr')?.getAttribute('data-level')).toBe('fault');
    expect(cell(host, 'flags', 'NK1')).toBe('jam');
    show(twin, 2);
    view.write(4900);
    expect(order(host)).toEqual(['NK1', 'LKN', 'RKN']);
    view.write(5100);
    expect(order(host)).toEqual(['LKN', 'RKN', 'NK1']);
  });

  it('shows a joint that slides in metres, whatever angles are shown in', () => {
    const schema = parseSchema(
      JSON.stringify({
        ...{ type: 'schema', v: 1, robot: 'Gripper', labels: { joint: ['arm', 'finger'] } },
        fields: [
          { name: 'pos', unit: 'rad', scale: 0.0001, labels: 'joint' },
          { name: 'vel', unit: 'rad/s', scale: 0.001, labels: 'joint' },
        ],
        mapping: { units: { pos: { finger: 'm' }, vel: { finger: 'm/s' } } },
      }),
    );
    const twin = new RobotTwin('gripper', 0);
    twin.acceptSchema(schema);
    const codes = Int32Array.of(10_000, 293, 0, 25);
    const atMs = 0;
    twin.acceptState({
      schemaId: schema.id,
      seq: 1,
      tS: 0,
      codes,
      freshMs: 0,
      bornMs: 0,
      changedMs: 0,
      atMs,
    });
    const host = document.createElement('div');
    const view = new JointView(host, twin);
    const unit = (field: string) =>
      host.querySelector<HTMLElement>(`td[data-field="${field}"][data-label="finger"]`)?.dataset.unit;
    for (const [angle, arm] of [
      ['rad', '1.000'],
      ['deg', '57.3'],
    ] as const) {
      changeSettings({ angle });
      view.write(0);
      expect(cell(host, 'pos', 'arm')).toBe(arm);
      expect([cell(host, 'pos', 'finger'), unit('pos')]).toEqual(['0.0293', 'm']);
      expect([cell(host, 'vel', 'finger'), unit('vel')]).toEqual(['0.025', 'm/s']);
    }
  });

  it('shows degrees when asked to, with their unit', () => {
    const twin = twinOf();
    const host = document.createElement('div');
    const view = new JointView(host, twin);
    changeSettings({ angle: 'deg' });
    show(twin, 1, { 'pos.RKN': 1571 });
    view.write(0);
    expect(cell(host, 'pos', 'RKN')).toBe('90.0');
    expect([...host.querySelectorAll('thead .unit')].map((unit) => unit.textContent)).toEqual([
      '°',
      '°',
      '°',
      'A',
      '°C',
    ]);
  });

  it('writes only what has changed', () => {
    const twin = twinOf();
    const host = document.createElement('div');
    const view = new JointView(host, twin);
    show(twin, 1);
    view.write(0);
    const texts: string[] = [];
    const node = (field: string) =>
      host.querySelector(`[data-field="${field}"][data-label="RKN"]`)?.firstChild;
    for (const field of ['ref', 'pos', 'cur']) {
      const text = node(field);
      if (!(text instanceof Text)) throw new Error(field);
      let data = text.data;
      Object.defineProperty(text, 'data', {
        get: () => data,
        set: (next: string) => {
          texts.push(`${field} ${next}`);
          data = next;
        },
      });
    }
    show(twin, 2, { 'pos.RKN': 1 });
    view.write(100);
    expect(texts).toEqual(['pos 0.001']);
  });

  it('says hostile names as text', () => {
    const host = document.createElement('div');
    const twin = new RobotTwin('small', 0);
    const label = '<img src=x onerror=alert(1)>';
    const text = SCHEMA.text.replaceAll('"RKN"', JSON.stringify(label));
    twin.acceptSchema(parseSchema(text));
    new JointView(host, twin).write(0);
    expect(host.querySelector('img')).toBeNull();
    expect(order(host)).toContain(label);
  });
});

it('the sensor table shows every group with its units', () => {
  const twin = twinOf();
  const host = document.createElement('div');
  const view = new SensorView(host, twin);
  show(twin, 9, { 'ftf.RF.fz': 260, 'ftm.RF.mx': null });
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

it('velocity and effort have columns only where a robot reports them', () => {
  const columns = (schema: typeof SCHEMA) => {
    const twin = new RobotTwin('small', 0);
    const host = document.createElement('div');
    twin.acceptSchema(schema);
    const codes = new Int32Array(schema.size).fill(25);
    twin.acceptState({
      schemaId: schema.id,
      seq: 1,
      tS: 0,
      codes,
      freshMs: 0,
      bornMs: 0,
      changedMs: 0,
      atMs: 0,
    });
    new JointView(host, twin).write(0);
    return [...host.querySelectorAll('thead th')].map((head, i) =>
      [head.textContent, host.querySelector('tbody tr')?.children[i]?.textContent].join(' '),
    );
  };
  expect(columns(SCHEMA).join()).not.toMatch(/vel|effort/);
  const moving = JSON.parse(SCHEMA.text) as { fields: unknown[] };
  moving.fields.push(
    { name: 'vel', unit: 'rad/s', scale: 0.01, labels: 'joint' },
    { name: 'effort', unit: 'Nm', scale: 0.1, labels: 'joint' },
  );
  expect(columns(parseSchema(JSON.stringify(moving))).slice(1, 8)).toEqual([
    'refrad 0.025',
    'posrad 0.025',
    'errorrad 0.000',
    'velrad/s 0.25',
    'effortN·m 2.50',
    'curA 0.25',
    'temp°C 25.0',
  ]);
});
