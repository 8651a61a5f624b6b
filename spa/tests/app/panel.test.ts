// @vitest-environment happy-dom
import { parseSchema } from '@posecast/wire';
import { createElement, useState } from 'react';
import { afterEach, beforeAll, beforeEach, describe, expect, it, vi } from 'vitest';
import { Panel, type Tab } from '../../src/app/numbers/Panel.tsx';
import { setFilter } from '../../src/app/numbers/table/joint_view.ts';
import { FaultKeeper } from '../../src/app/state/fault_keeper.ts';
import { setOwnLimit } from '../../src/app/state/limits.ts';
import type { RobotLink } from '../../src/app/state/robot_link.ts';
import { HistoryKeeper } from '../../src/app/state/robot_link.ts';
import { changeSettings } from '../../src/app/state/settings.ts';
import { clearTraces, selection, selectJoint, traces } from '../../src/app/state/viewing.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { mount } from '../rigs/mounted.ts';
import { codesWith, SCHEMA, stateOf } from '../rigs/schema.ts';

const pen = new Proxy({}, { get: () => () => pen, set: () => true });

beforeAll(() => {
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
  vi.spyOn(HTMLCanvasElement.prototype, 'getContext').mockReturnValue(pen as never);
});

beforeEach(() => {
  changeSettings({ angle: 'rad', faultsFirst: true, limbs: false });
  setFilter('');
  clearTraces();
});

afterEach(() => {
  selectJoint(null);
});

function Page({ link }: { link: RobotLink }) {
  const [tab, onTab] = useState<Tab>('Joints');
  return createElement(Panel, { link, tab, onTab });
}

/** The numbers of a robot controlled by the test, on a page without a relay. */
async function panel(twin = new RobotTwin('small', 0)) {
  twin.acceptSchema(SCHEMA);
  const link = {
    twin,
    faults: new FaultKeeper(twin, Date.now),
    minute: new HistoryKeeper(twin),
    nowMs: Date.now,
    watch: { word: 'LIVE' },
  } as unknown as RobotLink;
  const { host, find, says: waitForText } = mount(Page, { link });
  let seq = 0;
  const say = async (changed: Parameters<typeof codesWith>[0], schema = SCHEMA) => {
    seq += 1;
    const codes = schema === SCHEMA ? codesWith(changed) : new Int32Array(schema.size);
    twin.acceptState(stateOf(codes, { schemaId: schema.id, seq, tS: seq / 30, atMs: Date.now() }));
  };
  const click = async (selector: string) => (await find(selector)).click();
  return { twin, host, say, find, click, waitForText };
}

/** Texts with invisible characters, or right-to-left letters outside the page's isolates. */
function shownRaw(host: HTMLElement): string[] {
  const texts = [...host.querySelectorAll('*')].flatMap((element) => [
    ...['title', 'aria-label', 'data-unit'].map((name) => element.getAttribute(name) ?? ''),
    ...[...element.childNodes].flatMap((node) => (node instanceof Text ? [node.data] : [])),
  ]);
  const raw = (text: string) => {
    const outside = text.replace(/\u2068[^\u2068\u2069]*\u2069/g, '');
    // the page's own: a figure space in place of a sign
    return /(?![ \u2007])[\p{C}\p{Z}]/u.test(outside) || /[\u0590-\u08ff]/.test(outside);
  };
  return texts.filter(raw).map((text) => JSON.stringify(text));
}

describe('the numbers', { timeout: 60_000 }, () => {
  it('of a robot without joints open on its sensors, with where its base is', async () => {
    const drone = parseSchema(
      JSON.stringify({
        ...{ type: 'schema', v: 1, robot: 'Drone' },
        labels: { base: ['base.x', 'base.y', 'base.z'], baseq: ['base.w', 'base.x', 'base.y', 'base.z'] },
        fields: [
          { name: 'base', unit: 'm', scale: 0.001, labels: 'base' },
          { name: 'baseq', scale: 0.001, labels: 'baseq' },
        ],
      }),
    );
    const { twin, host, say, find, click, waitForText } = await panel();
    await find('#tab-Joints');
    twin.acceptSchema(drone);
    await say({}, drone);
    await waitForText('[data-testid=sensor-table]', /^Base.*x.*0\.000.*m.*z.*yaw/s);
    expect([...host.querySelectorAll('[role=tab]')].map(({ id }) => id)).toEqual([
      ...['tab-Sensors', 'tab-Plots', 'tab-Alarms'],
    ]);
    await click('td[data-field="base"][data-label="base.z"]');
    expect(traces()).toEqual([{ field: 'base', label: 'base.z' }]);
    twin.acceptSchema(SCHEMA);
    await find('#tab-Joints[aria-selected=true]');
  });

  it('claim that there are no faults only if one could be known', async () => {
    const doc = JSON.parse(SCHEMA.text);
    const tells = (changed: object, mapping: object, name: string) => {
      const fields = doc.fields.flatMap((field: { name: string }) =>
        field.name !== 'flags' ? [field] : 'flags' in changed ? [{ ...field, ...changed }] : [],
      );
      return parseSchema(JSON.stringify({ ...doc, robot: name, fields, mapping }));
    };
    const { twin, say, waitForText } = await panel();
    for (const [schema, words] of [
      [tells({}, {}, 'nothing'), 'No faults reported'],
      [tells({ flags: 1 }, {}, 'flags'), 'No faults'],
      [
        tells({ flags: 1, bits: ['homed'] }, { severity: { flags: { homed: 'state' } } }, 'states'),
        'No faults reported',
      ],
      [tells({}, { tolerance: { LKN: 0.1 } }, 'tolerance'), 'No faults'],
      [tells({}, { tolerance: { elsewhere: 0.1 } }, 'another'), 'No faults reported'],
      [tells({}, { thresholds: { volt: { main: { low: 40, caution: 0.8 } } } }, 'limit'), 'No faults'],
    ] as const) {
      twin.acceptSchema(schema);
      await say({}, schema);
      await waitForText('[data-testid=fault-line]', new RegExp(`^${words}$`));
    }
  });

  it('end a fault without a word of its own without a separator', async () => {
    const start = Date.now();
    const clock = vi.spyOn(Date, 'now').mockReturnValue(start);
    const { say, waitForText } = await panel();
    for (const ms of [0, 1000, 2000, 3000]) {
      clock.mockReturnValue(start + ms);
      await say({ 'ref.RKN': 500 });
    }
    clock.mockRestore();
    await waitForText('[data-told=true]', /^Right knee is not where.*RKN/);
    await waitForText('.fault-small', /^RKN$/);
  });

  it('open the card of a joint, whose values go into plots, and close it again', async () => {
    const { say, click, find, host, waitForText } = await panel();
    await say({ 'pos.RKN': 250, 'flags.RKN': 4 });
    await click('tr[data-label="RKN"] button');
    await waitForText('[data-testid=joint-card]', /RKN.*right knee.*jam.*still there.*position/s);
    await click('[data-testid=plot-pos]');
    await click('[data-testid=plot-error]');
    expect(traces().map(({ field }) => field)).toEqual(['pos', 'error']);
    await waitForText('#tab-Plots', 'Plots2');
    await click('#tab-Plots');
    await waitForText('.plot-legend', /RKN pos.*0\.250/);
    await click('[data-testid=plot-pause]');
    await say({ 'pos.RKN': 900 });
    await waitForText('[data-testid=plot-pause]', 'Resume');
    expect(host.querySelector('.plot-legend')?.textContent).toMatch(/0\.250/);
    selectJoint('RKN');
    await find('#tab-Joints[aria-selected=true]');
    await find('[data-testid=joint-card]');
    await vi.waitFor(() => {
      window.dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape' })); // it starts listening a moment after it is shown
      expect(host.querySelector('[data-testid=joint-card]')).toBeNull();
    }, 20_000);
    expect(selection()).toBeNull();
  });

  it('take a sensor into the plots and out again, and show one that fell silent as old', async () => {
    const { say, click, find, waitForText } = await panel();
    await say({ 'ftf.RF.fz': 260 });
    await click('#tab-Sensors');
    await waitForText('[data-field="ftf"]', '260.0');
    await click('.sensor tr:has([data-field="ftf"]) button');
    expect(traces()).toEqual([{ field: 'ftf', label: 'RF.fz' }]);
    await say({ 'ftf.RF.fz': null });
    await find('[data-field="ftf"][data-old]');
    await waitForText('[data-field="ftf"]', '260.0');
    await click('.sensor tr:has([data-field="ftf"]) button');
    expect(traces()).toEqual([]);
  });

  it("tell when a limit of the viewer's own is crossed, with the time", async () => {
    const { twin, say, click, waitForText } = await panel();
    await click('#tab-Alarms');
    await waitForText('.tab-body', 'No events have been received.');
    setOwnLimit(twin, 'ftf', 'RF.fz', { low: null, high: 100, caution: 1 });
    await say({ 'ftf.RF.fz': 50 });
    await say({ 'ftf.RF.fz': 150 });
    await say({ 'ftf.RF.fz': 10 });
    await waitForText(
      '[data-testid=alarms]',
      /\d\d:\d\d:\d\dright foot Fz above 100 Nyour limit ended.*right foot Fz above 100 Nyour limit/,
    );
    setOwnLimit(twin, 'ftf', 'RF.fz', null);
  });

  it('show names that hide, or turn their neighbours, harmless in every tab', async () => {
    const { twin, say, click, find, host } = await panel();
    const [turning, hidden, hebrew] = ['RKN\u202e', 'RKN\u200b', '\u05d0\u05d1\u05d2'];
    const odd = JSON.parse(SCHEMA.text);
    odd.labels.joint = [turning, hidden, hebrew];
    odd.labels.sonar = [hebrew];
    odd.fields[1].unit = hebrew;
    odd.fields.at(-1).bits[2] = turning;
    odd.mapping.names = { [turning]: `${hebrew} 7`, [hidden]: hidden };
    odd.mapping.sensors.RF.name = `${hebrew}\u2069\u2069`;
    odd.mapping.units = { pos: { [hidden]: turning } };
    const schema = parseSchema(JSON.stringify(odd));
    const event = { type: 'event', n: 1, t: 0, at: 0, level: 'fault', state: 'on' } as const;
    twin.acceptSchema(schema);
    twin.acceptEvent({ ...event, source: turning, text: `jam ${hidden}` });
    twin.acceptEvent({ ...event, n: 2, source: hebrew, text: turning });
    await say({}, schema);

    const raw = document.createElement('div');
    raw.innerHTML = `<p title="${hebrew}">${turning}</p>`;
    expect(shownRaw(raw)).toHaveLength(2);
    const harmless = (what: string) => expect(shownRaw(host), what).toEqual([]);
    await find('tr[data-label] button');
    const names = [...host.querySelectorAll('tbody th button')].map(({ textContent }) => textContent);
    const shown = ['RKN\\u{202e}', 'RKN\\u{200b}', `\u2068${hebrew}\u2069`];
    expect(names.sort()).toEqual(shown.sort());
    harmless('table');
    changeSettings({ limbs: true });
    await find('tr.limb');
    harmless('limbs');
    for (const joint of [turning, hidden, hebrew]) {
      selectJoint(joint);
      await find('[data-testid=joint-card] dl');
      await find('.card-room :is(ol, dl)');
      harmless('card');
      await click('[data-testid=plot-pos]');
    }
    for (const [tab, part] of [
      ['Sensors', '.sensor td'],
      ['Plots', '.plot-name'],
      ['Alarms', '[data-testid=alarms] li'],
    ] as const) {
      await click(`#tab-${tab}`);
      await find(part);
      harmless(tab);
    }
  });

  it('stand when the robot comes back with other joints and names that bite', async () => {
    const { twin, say, click, host, waitForText } = await panel();
    await say({ 'pos.RKN': 250 });
    await click('tr[data-label="RKN"] button');
    await waitForText('[data-testid=joint-card]', 'right knee');
    const odd = '<img src=x onerror=alert(1)>';
    const other = parseSchema(
      SCHEMA.text.replace('"joint":["LKN","RKN","NK1"]', `"joint":[${JSON.stringify(odd)},"__proto__","a"]`),
    );
    twin.acceptSchema(other);
    await say({}, other);
    await waitForText('[data-testid=joint-card]', 'This robot has no such joint now.');
    for (const label of [odd, '__proto__']) {
      selectJoint(label);
      await waitForText('[data-testid=joint-card] h2', label);
      await waitForText('[data-testid=joint-card]', 'Where the joint is');
    }
    expect(host.querySelector('img')).toBeNull();
  });
});
