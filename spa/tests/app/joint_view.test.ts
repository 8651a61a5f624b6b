// @vitest-environment happy-dom
import { parseSchema } from '@posecast/wire';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { Ranks } from '../../src/app/numbers/table/joint_row.ts';
import {
  filterText,
  JointView,
  setFilter,
  type TableSources,
} from '../../src/app/numbers/table/joint_view.ts';
import { NameColumn } from '../../src/app/numbers/table/name_column.ts';
import { createElement } from '../../src/app/shell/cells.ts';
import { changeSettings } from '../../src/app/state/settings.ts';
import { selection, selectJoint } from '../../src/app/state/viewing.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { LastReadings } from '../../src/twin/sensors/last_readings.ts';
import { codesWith, SCHEMA, stateOf } from '../rigs/schema.ts';

const JAM = 4;

/** A table on a separate page, and functions to simulate its robot's reports. */
function table(from: TableSources = {}, schema = SCHEMA) {
  const twin = new RobotTwin('small', 0);
  const host = document.createElement('div');
  document.body.append(host);
  const readings = new LastReadings();
  twin.onState(() => readings.push(twin.schema!, twin.state!));
  const view = new JointView(host, twin, { readings, ...from });
  twin.acceptSchema(schema);
  let seq = 0;
  const say = (changed: Parameters<typeof codesWith>[0], atMs: number, codes = codesWith(changed)) => {
    seq += 1;
    twin.acceptState(stateOf(codes, { schemaId: schema.id, seq, tS: seq / 30, atMs }));
    view.write(atMs);
  };
  const cell = (field: string, label: string) =>
    host.querySelector<HTMLElement>(`td[data-field="${field}"][data-label="${label}"]`)!;
  const shown = () =>
    [...host.querySelectorAll<HTMLElement>('tbody tr')]
      .filter((row) => !row.hidden && !(row.parentElement as HTMLElement).hidden)
      .map((row) => row.dataset.label ?? `# ${row.textContent}`);
  return { twin, host, view, say, cell, shown };
}

beforeEach(() => {
  changeSettings({ angle: 'rad', faultsFirst: true, limbs: false });
  setFilter('');
  selectJoint(null);
  document.body.replaceChildren();
});

describe('the order', () => {
  it('has faults first, then what has been doubtful for a second, then the rest as the robot has it', () => {
    const { say, shown } = table();
    say({ 'pos.NK1': 100 }, 0);
    expect(shown(), 'late just now').toEqual(['LKN', 'RKN', 'NK1']);
    say({ 'pos.NK1': 100 }, 1100);
    expect(shown()).toEqual(['NK1', 'LKN', 'RKN']);
    say({ 'pos.NK1': 100, 'flags.RKN': JAM }, 1200);
    expect(shown()).toEqual(['RKN', 'NK1', 'LKN']);
    say({}, 6300);
    expect(shown()).toEqual(['LKN', 'RKN', 'NK1']);
  });

  it('is limb by limb where that is wanted, one with a fault before the others', () => {
    changeSettings({ limbs: true });
    const { say, shown, twin, view } = table();
    say({}, 0);
    expect(shown()).toEqual(['# Left 1', 'LKN', '# Right leg 1', 'RKN', '# Other joints 1', 'NK1']);
    say({ 'flags.NK1': JAM }, 100);
    expect(shown()).toEqual(['# Other joints 1', 'NK1', '# Left 1', 'LKN', '# Right leg 1', 'RKN']);
    changeSettings({ limbs: false });
    view.write(200);
    expect(shown()).toEqual(['NK1', 'LKN', 'RKN']);
    expect(twin.tree).toBeNull();
  });
});

describe('a row that goes up or down', () => {
  /** The rows and limbs moved since, by name. */
  function moves(host: HTMLElement) {
    const seen = new MutationObserver(() => {});
    for (const each of host.querySelectorAll('table, tbody')) seen.observe(each, { childList: true });
    return () =>
      seen
        .takeRecords()
        .flatMap(({ addedNodes }) => [...addedNodes] as HTMLElement[])
        .map((moved) => moved.dataset.label ?? moved.textContent!.trim().split(' ')[0]);
  }
  const focused = () => document.activeElement?.closest<HTMLElement>('tr')?.dataset.label;

  it('moves alone, and takes the focus from no other', () => {
    const { say, shown, host } = table();
    say({}, 0);
    const moved = moves(host);
    host.querySelector<HTMLElement>('tr[data-label="RKN"] button')!.focus();
    say({ 'flags.NK1': JAM }, 100);
    expect(shown()).toEqual(['NK1', 'LKN', 'RKN']);
    expect([moved(), focused()]).toEqual([['NK1'], 'RKN']);
    say({}, 6000);
    expect(shown()).toEqual(['LKN', 'RKN', 'NK1']);
    expect([moved(), focused()]).toEqual([['NK1'], 'RKN']);
  });

  it('stays in the document while it has the focus: the others go around it', () => {
    const { say, shown, host } = table();
    say({}, 0);
    const moved = moves(host);
    host.querySelector<HTMLElement>('tr[data-label="NK1"] button')!.focus();
    say({ 'flags.NK1': JAM }, 100);
    expect(shown()).toEqual(['NK1', 'LKN', 'RKN']);
    expect([moved(), focused()]).toEqual([['RKN', 'LKN'], 'NK1']);
    say({ 'flags.NK1': JAM, 'flags.RKN': JAM }, 200);
    expect(shown()).toEqual(['RKN', 'NK1', 'LKN']);
    expect([moved(), focused()]).toEqual([['RKN'], 'NK1']);
    say({}, 6000);
    expect(shown()).toEqual(['LKN', 'RKN', 'NK1']);
    expect([moved(), focused()]).toEqual([['RKN', 'LKN'], 'NK1']);
  });

  it('takes its limb along in the same way', () => {
    changeSettings({ limbs: true });
    const { say, shown, host } = table();
    say({}, 0);
    const moved = moves(host);
    host.querySelector<HTMLElement>('tr[data-label="NK1"] button')!.focus();
    say({ 'flags.NK1': JAM }, 100);
    expect(shown()).toEqual(['# Other joints 1', 'NK1', '# Left 1', 'LKN', '# Right leg 1', 'RKN']);
    expect(focused()).toBe('NK1');
    expect(moved()).toHaveLength(2);
    say({}, 6000);
    expect(shown()).toEqual(['# Left 1', 'LKN', '# Right leg 1', 'RKN', '# Other joints 1', 'NK1']);
    expect(focused()).toBe('NK1');
    expect(moved()).toHaveLength(2);
  });
});

describe('the filter', () => {
  it('looks for every word in names, limbs and flags, and goes on as they change', () => {
    const { say, shown, host } = table();
    say({}, 0);
    setFilter('KNEE right');
    expect(shown()).toEqual(['RKN']);
    setFilter('jam');
    expect(shown()).toEqual([]);
    expect(host.querySelector<HTMLElement>('.note')?.textContent).toBe('No joint matches “jam”.');
    say({ 'flags.LKN': JAM }, 100);
    expect(shown()).toEqual(['LKN']);
    expect(host.querySelector<HTMLElement>('.note')?.hidden).toBe(true);
    setFilter('caution');
    say({ 'pos.RKN': 100 }, 200);
    expect(shown()).toEqual(['RKN']);
  });

  it('survives another schema, and gives way to a joint that is chosen', () => {
    const { twin, say, shown, host, view } = table();
    say({}, 0);
    setFilter('kn');
    expect(shown()).toEqual(['LKN', 'RKN']);
    const other = parseSchema(
      SCHEMA.text.replace('"joint":["LKN","RKN","NK1"]', '"joint":["RKN","ELB","REB"]'),
    );
    twin.acceptSchema(other);
    view.write(100);
    expect(shown()).toEqual(['RKN']);
    expect(filterText()).toBe('kn');
    selectJoint('ELB');
    expect(filterText()).toBe('');
    expect(shown()).toEqual(['RKN', 'ELB', 'REB']);
    expect(host.querySelector<HTMLElement>('[aria-current]')?.dataset.label).toBe('ELB');
  });
});

describe('the chosen joint', () => {
  it('is marked, also in a table that is built later', () => {
    const { say, host, view, twin } = table();
    say({}, 0);
    host.querySelector<HTMLElement>('tr[data-label="RKN"] button')?.click();
    expect(selection()).toEqual({ joint: 'RKN', from: 'numbers' });
    const marked = () =>
      [...host.querySelectorAll<HTMLElement>('[aria-current]')].map((row) => row.dataset.label);
    expect(marked()).toEqual(['RKN']);
    twin.acceptSchema(parseSchema(SCHEMA.text.replace('"Small"', '"Other"')));
    view.write(0);
    expect(marked()).toEqual(['RKN']);
    selectJoint('LKN', 'body');
    expect(marked()).toEqual(['LKN']);
    selectJoint(null);
    expect(marked()).toEqual([]);
    view.dispose();
    selectJoint('RKN');
    expect(host.childElementCount).toBe(0);
  });
});

describe('a reading that is gone', () => {
  it('stays, marked as old and with its age in words, while frames go on', () => {
    const { say, cell } = table();
    say({ 'cur.RKN': 150, 'pos.RKN': 250, 'ref.RKN': 250 }, 0);
    expect(cell('cur', 'RKN').hasAttribute('data-old')).toBe(false);
    const gone = { 'cur.RKN': null, 'pos.RKN': null, 'ref.RKN': 250 };
    say(gone, 100);
    expect(cell('cur', 'RKN').textContent).toBe('1.50');
    expect(cell('cur', 'RKN').hasAttribute('data-old')).toBe(true);
    expect(cell('error', 'RKN').textContent, 'computed of what is read now').toBe('—');
    expect(cell('flags', 'RKN').textContent, 'too short to speak of').toBe('');
    say(gone, 12_400);
    expect(cell('flags', 'RKN').textContent).toBe('pos, cur 12 s old');
    say({ 'cur.RKN': 160, 'pos.RKN': 250 }, 12_500);
    expect(cell('cur', 'RKN').textContent).toBe('1.60');
    expect(cell('cur', 'RKN').hasAttribute('data-old')).toBe(false);
    expect(cell('flags', 'RKN').textContent).toBe('');
  });

  it('is "—" where there never was one', () => {
    const { say, cell } = table();
    say({ 'temp.RKN': null }, 0);
    say({ 'temp.RKN': null }, 9000);
    expect(cell('temp', 'RKN').textContent).toBe('—');
    expect(cell('temp', 'RKN').hasAttribute('data-old')).toBe(false);
  });
});

describe('rows that nobody sees', () => {
  /** The page's report of which rows are on screen. */
  let tell: (seen: Record<string, boolean>) => void = () => {};
  class Sight {
    readonly #rows: HTMLElement[] = [];
    constructor(told: (entries: { target: Element; isIntersecting: boolean }[]) => void) {
      tell = (seen) =>
        told(
          this.#rows.flatMap((target) => {
            const isIntersecting = seen[target.dataset.label ?? ''];
            return isIntersecting === undefined ? [] : [{ target, isIntersecting }];
          }),
        );
    }
    observe(row: HTMLElement) {
      this.#rows.push(row);
    }
    disconnect() {
      this.#rows.length = 0;
    }
  }
  beforeEach(() => vi.stubGlobal('IntersectionObserver', Sight));
  afterEach(() => {
    vi.unstubAllGlobals();
    vi.useRealTimers();
  });

  it('are written in turns, at once when they come into sight, and all of them after the last frame', () => {
    vi.useFakeTimers();
    const { say, cell, host } = table();
    say({ 'pos.LKN': 0, 'pos.NK1': 0 }, 0);
    tell({ LKN: true, RKN: true, NK1: false });
    const shown = () => ['LKN', 'NK1'].map((label) => Number(cell('pos', label).textContent?.trim()) * 1000);
    let late = 0;
    for (let n = 1; n <= 40; n += 1) {
      say({ 'pos.LKN': n, 'pos.NK1': n }, n * 100);
      expect(shown()[0], 'on the screen').toBe(n);
      late = Math.max(late, n - shown()[1]!);
    }
    expect(late, 'within two seconds').toBe(19);
    say({ 'flags.NK1': JAM, 'pos.NK1': 41 }, 4100);
    expect(cell('flags', 'NK1').textContent, 'a fault is not kept waiting').toBe('jam');
    expect(host.querySelector<HTMLElement>('tbody tr')?.dataset.label).toBe('NK1');
    tell({ NK1: true });
    expect(shown()[1]).toBe(41);
    tell({ NK1: false });
    say({ 'pos.NK1': 42 }, 4200);
    say({ 'pos.NK1': 43 }, 4300);
    vi.advanceTimersByTime(1000);
    expect(shown()[1], 'nothing comes any more').toBe(43);
  });
});

describe('what an update costs', () => {
  const label = Array.from({ length: 60 }, (_, i) => `J${i}`);
  const wide = parseSchema(
    JSON.stringify({
      ...JSON.parse(SCHEMA.text),
      labels: { ...JSON.parse(SCHEMA.text).labels, joint: label },
      mapping: {},
    }),
  );
  const pose = (changed: Readonly<Record<string, number>>) => {
    const codes = new Int32Array(wide.size);
    for (const [channel, code] of Object.entries(changed)) {
      const [name = '', joint = ''] = channel.split('.');
      const field = wide.field(name)!;
      codes[field.start + field.labels.indexOf(joint)] = code;
    }
    return codes;
  };

  it('is one write in the page for each value that changed, of 60 rows, and nothing grows', async () => {
    const { say, host } = table({}, wide);
    say({}, 0, pose({}));
    const seen: MutationRecord[] = [];
    const observer = new MutationObserver((records) => seen.push(...records));
    observer.observe(host, { subtree: true, childList: true, characterData: true, attributes: true });
    const counted = async () => {
      await new Promise((resolve) => setTimeout(resolve));
      return seen.splice(0).filter(({ attributeName }) => attributeName !== 'data-seq');
    };
    say({}, 100, pose({}));
    expect(await counted(), 'an unchanged robot').toHaveLength(0);
    say({}, 200, pose({ 'pos.J7': 1, 'cur.J9': 3 }));
    // pos, and the error computed from it; cur
    expect((await counted()).map(({ type }) => type)).toEqual(Array(3).fill('characterData'));
    observer.disconnect();
    const nodes = host.querySelectorAll('*').length;
    for (let n = 0; n < 300; n += 1) {
      const walk = Object.fromEntries(label.map((joint, i) => [`pos.${joint}`, (n * (i + 1)) % 40]));
      say({}, 300 + n * 100, pose(walk));
    }
    expect(host.querySelectorAll('*').length).toBe(nodes);
  });
});

describe('the columns', () => {
  const heads = (host: HTMLElement) => [...host.querySelectorAll('thead th')].map((head) => head.textContent);

  it('show what the robot reports, in the units that the viewer wants', () => {
    const { host, view, say, cell } = table();
    view.write(0);
    expect(host.querySelectorAll('tbody th'), 'before the first frame has come').toHaveLength(3);
    expect(host.querySelector('table')?.dataset.seq).toBeUndefined();
    say({ 'ref.RKN': 500, 'pos.RKN': -480, 'temp.RKN': null, 'flags.RKN': 1 }, 0);
    expect(host.querySelector('table')?.dataset.seq).toBe('1');
    const shown = ['ref', 'pos', 'error', 'temp', 'homed', 'enabled'].map(
      (field) => cell(field, 'RKN').textContent,
    );
    expect(shown).toEqual(['0.500', '\u22120.480', '0.980', '—', '✓', 'no']);
    changeSettings({ angle: 'deg' });
    say({ 'pos.RKN': 1571 }, 100);
    expect(cell('pos', 'RKN').textContent).toBe('90.0');
    expect([...host.querySelectorAll('thead .unit')].map(({ textContent }) => textContent)).toEqual([
      ...['°', '°', '°', 'A', '°C'],
    ]);
    expect(heads(host).join()).not.toMatch(/vel|effort/);
  });

  it('have another unit for a joint that slides, whatever angles are shown in', () => {
    const gripper = parseSchema(
      JSON.stringify({
        ...{ type: 'schema', v: 1, robot: 'Gripper', labels: { joint: ['arm', 'finger'] } },
        fields: [
          { name: 'pos', unit: 'rad', scale: 0.0001, labels: 'joint' },
          { name: 'vel', unit: 'rad/s', scale: 0.001, labels: 'joint' },
        ],
        mapping: { units: { pos: { finger: 'm' }, vel: { finger: 'm/s' } } },
      }),
    );
    const { say, cell } = table({}, gripper);
    const shown = (field: string) => [cell(field, 'finger').textContent, cell(field, 'finger').dataset.unit];
    for (const [angle, arm] of [
      ['rad', '1.000'],
      ['deg', '57.3'],
    ] as const) {
      changeSettings({ angle });
      say({}, 0, Int32Array.of(10_000, 293, 0, 25));
      expect(cell('pos', 'arm').textContent).toBe(arm);
      expect([shown('pos'), shown('vel')]).toEqual([
        ['0.0293', 'm'],
        ['0.025', 'm/s'],
      ]);
    }
  });
});

describe('the rank of a row', () => {
  it('is the top while it is faulty, and for five seconds after', () => {
    const ranks = new Ranks(2);
    ranks.set(1, 'fault', false);
    expect([ranks.of(0, 0), ranks.of(1, 0)]).toEqual([0, 2]);
    ranks.set(1, 'ok', false);
    expect([4999, 5000].map((ms) => ranks.of(1, ms))).toEqual([2, 0]);
  });

  it('is the top as long as a fault of it waits to be acknowledged, and five seconds from its end', () => {
    const ranks = new Ranks(1);
    ranks.set(0, 'fault', true);
    ranks.of(0, 0);
    ranks.set(0, 'ok', true);
    expect(ranks.of(0, 60_000)).toBe(2);
    ranks.set(0, 'ok', false);
    expect(ranks.of(0, 60_001)).toBe(0);
    ranks.set(0, 'fault', true);
    ranks.of(0, 70_000);
    ranks.set(0, 'ok', false);
    expect(ranks.of(0, 71_000)).toBe(2);
  });

  it('rises for a caution only when it has lasted a second, also with gaps', () => {
    const ranks = new Ranks(1);
    ranks.set(0, 'caution', false);
    expect([0, 999, 1000].map((ms) => ranks.of(0, ms))).toEqual([0, 0, 1]);
    ranks.set(0, 'ok', false);
    expect([5999, 6000].map((ms) => ranks.of(0, ms))).toEqual([1, 0]);
    ranks.set(0, 'caution', false);
    expect(ranks.of(0, 6001), 'a new one').toBe(0);
  });
});

const LABELS = ['left_hip_pitch_joint', 'left_hip_roll_joint', 'left_knee_joint'];

/** A table of three columns, the middle one 100 px wide, in this much room. Nothing is measured: a letter is 7 px wide. */
function columnIn(room: { px: number }) {
  const host = createElement('div', '');
  Object.defineProperty(host, 'clientWidth', { get: () => room.px });
  const table = createElement('table', 'joints');
  const head = createElement('thead', '');
  for (const width of [0, 100, 0]) {
    const cell = createElement('th', '');
    Object.defineProperty(cell, 'offsetWidth', { get: () => width });
    head.append(cell);
  }
  table.append(head);
  const cells = LABELS.map((label) => {
    const button = createElement('button', '', label);
    createElement('th', '').append(button);
    return { button, name: label };
  });
  host.append(table);
  document.body.append(host);
  const column = new NameColumn(table, cells);
  const shown = () => cells.map(({ button }) => button.textContent);
  return { column, table, shown, cells };
}

it('is as wide as the names, and says them whole to whoever listens where they are cut', () => {
  const room = { px: 400 };
  const { column, table, shown, cells } = columnIn(room);
  column.fit();
  expect(shown()).toEqual(LABELS);
  const wide = Number.parseFloat(table.style.getPropertyValue('--joint-width'));
  expect(wide).toBeGreaterThanOrEqual(20 * 7);
  expect(wide).toBeLessThan(20 * 7 + 10);
  expect(cells[0]!.button.hasAttribute('aria-label')).toBe(false);

  room.px = 290;
  column.fit();
  expect(new Set(shown()).size).toBe(3);
  expect(shown()[0]).toContain('…');
  expect(cells[0]!.button.getAttribute('aria-label')).toBe(LABELS[0]);
  expect(table.dataset.crowded).toBe('');

  room.px = 200;
  column.fit();
  expect(table.dataset.crowded, 'columns that stand in the card make room').toBe('more');
  expect(new Set(shown()).size).toBe(3);

  room.px = 400;
  column.fit();
  expect(shown()).toEqual(LABELS);
  expect(cells[0]!.button.hasAttribute('aria-label')).toBe(false);
  expect(table.dataset.crowded).toBe('');
});

it('waits until there is room at all', () => {
  const { column, table, shown } = columnIn({ px: 0 });
  column.fit();
  expect(shown()).toEqual(LABELS);
  expect(table.style.getPropertyValue('--joint-width')).toBe('');
});
