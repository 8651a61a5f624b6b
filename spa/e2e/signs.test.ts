import { describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import type { Process } from './process.ts';
import { body, drawsNothing, enter, finest, gone, holds, is, renderedFrames, there } from './robot_page.ts';
import { choose, DEMO, demoAt, FAULT, labels, shown, signs } from './sign_words.ts';
import type { Relay, Sample } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const PHONE = { width: 390, height: 844 };
const LAPTOP = { width: 1280, height: 800 };

const robot = stage.share(async (stack, newPage) => {
  const relay = await stack.relay();
  const { source } = stack.fedEdge(relay, demoAt(38), DEMO);
  const page = await newPage({ viewport: LAPTOP });
  await page.open(`${relay.url}/#/r/demo`);
  return { source, page };
});

/** A robot and a page of its own. */
async function standing(
  sample: Sample,
  preload = '',
): Promise<{ relay: Relay; source: Process; page: Page }> {
  const relay = await stage.stack.relay();
  const { source } = stage.stack.fedEdge(relay, sample, DEMO);
  const page = await stage.open(`${relay.url}/#/r/demo`, { preload });
  await shown(page);
  return { relay, source, page };
}

/** Draw calls of a picture in which only the camera has moved: no shadows. */
async function calls(page: Page): Promise<number> {
  await until('the finest shells', () => finest(page));
  const before = await renderedFrames(page);
  await page.findByRole('button', 'side').click();
  await until('another picture', async () => (await renderedFrames(page)) > before);
  await until('rest', holds(page, 'window.posecast.scene.resting'));
  return page.evaluate<number>('window.posecast.scene.drawCalls');
}

describe('what a robot does not say', () => {
  it('a robot without odometry leans as its IMU says, and stays so when the IMU falls silent', async () => {
    const { base: _, baseq: __, ...sample } = demoAt(1);
    const turned = (w: number, x: number) => ({
      ...sample,
      quat: { ...sample.quat, 'torso.w': w, 'torso.x': x, 'torso.y': 0, 'torso.z': 0 },
    });
    const { source, page } = await standing(turned(1, 0));
    /** The y and z components, in the world, of the torso's own up axis. */
    const up = async () => {
      const pose = (await body(page))?.links.Body_Torso ?? [];
      return [pose[6] ?? Number.NaN, pose[10] ?? Number.NaN] as const;
    };
    await until('upright', async () => (await up())[1] > 0.9999);
    source.write(JSON.stringify(turned(Math.cos(0.1), Math.sin(0.1)))); // a roll of 0.2 rad
    await until('leaning', async () => {
      const [y, z] = await up();
      return Math.abs(y + Math.sin(0.2)) < 0.002 && Math.abs(z - Math.cos(0.2)) < 0.002;
    });
    const { level } = await signs(page);
    expect(level.roll).toBeCloseTo(0.2, 2);
    expect(level.planeZ, 'the plane lies at the lowest foot').toBeCloseTo(0, 3);
    source.write(JSON.stringify(turned(0, 0)));
    await until('no reading', async () => (await signs(page)).level.roll === null);
    expect((await up())[0]).toBeCloseTo(-Math.sin(0.2), 2);
  });

  it('no force sensors, no IMU, two hundred joints: nothing is invented, and nothing is offered', async () => {
    const relay = await stage.stack.relay();
    const many = Object.fromEntries(Array.from({ length: 200 }, (_, i) => [`j${i}`, i / 100]));
    stage.stack.fedEdge(
      relay,
      { ref: { ...many, RKN: 0.4 }, pos: { ...many, RKN: 0 } },
      { model: DEMO.model },
    );
    const page = await stage.open(`${relay.url}/#/r/demo`);
    await shown(page);
    await until('LIVE or HOLDING', is(page, 'LIVE', 'HOLDING'));
    expect(await signs(page)).toMatchObject({
      wrenches: [],
      deviations: [],
      level: { planeZ: null, roll: null },
      ghostLinks: [],
    });
    await page.findByRole('button', 'Signs').click();
    const offered = await page.findByTestId('sign-menu').text();
    expect(offered).toContain('Limbs off their command');
    expect(offered).not.toMatch(/forces|level|colou?r/i); // balance comes with the masses of its model
    expect(await page.findByTestId('level').visible()).toBe(false);
  });

  it('a force without a reading is named, an orientation of length zero is none; the page stays up', async () => {
    const sample = demoAt(1);
    const { source, page } = await robot();
    source.write(JSON.stringify(sample));
    await shown(page);
    await until('a level', async () => (await signs(page)).level.roll !== null);
    const broken = {
      ...sample,
      ftf: { ...sample.ftf, 'RF.fz': null },
      quat: Object.fromEntries(Object.keys(sample.quat ?? {}).map((label) => [label, 0])),
    };
    source.write(JSON.stringify(broken));
    await until('no reading', async () => (await labels(page)).includes('wrench-RF: right foot: no reading'));
    const now = await signs(page);
    expect(now.wrenches.find(({ site }) => site === 'RF')?.force).toMatchObject({ value: null, size: 0 });
    expect(now.level).toMatchObject({ roll: null, pitch: null, feet: [] });
    expect(await page.findByTestId('level').text()).toContain('—');
    expect(
      Object.values((await body(page))?.links ?? {})
        .flat()
        .every(Number.isFinite),
    ).toBe(true);
  });
});

describe('the lens', () => {
  it('finds the jammed knee of the demo robot: a ghost of that limb alone, an arc, a label, one draw call', async () => {
    const still = demoAt(38);
    const jammed = demoAt(42);
    const { source, page } = await robot();
    source.write(JSON.stringify(still));
    await shown(page);
    await until('signs, and no ghost', async () => {
      const { wrenches, ghostLinks, level } = await signs(page);
      return wrenches.length === 4 && ghostLinks.length === 0 && level.roll !== null;
    });
    const without = await calls(page);
    expect(without, 'the whole scene').toBeLessThanOrEqual(19);

    source.write(JSON.stringify(jammed));
    const found = await until('a ghost', async () => {
      const now = await signs(page);
      return now.ghostLinks.length > 0 ? now : null;
    });
    expect(found.deviations.map(({ channel }) => channel)).toEqual(['RKN']);
    expect(found.deviations[0]?.error).toBeCloseTo((jammed.ref?.RKN ?? 0) - (jammed.pos?.RKN ?? 0), 2);
    expect(found.ghostLinks, 'what hangs on the knee').toContain('Body_RAR');
    for (const other of ['Body_RHP', 'Body_LAR', 'Body_Torso']) expect(found.ghostLinks).not.toContain(other);
    expect(await labels(page)).toContainEqual(expect.stringMatching(/^apart-RKN: RKN 0\.\d+ rad off$/));
    // More while shadows are redrawn.
    await until('one draw call more', async () => (await calls(page)) === without + 1);

    source.write(JSON.stringify(still));
    await until('no ghost', async () => (await signs(page)).ghostLinks.length === 0);
    await until('as many as before', async () => (await calls(page)) === without);
  });

  it.skipIf(!FULL)(
    'names a limb that yields on purpose and draws no ghost of it; "both" shows the whole one',
    async () => {
      const yielding = demoAt(29.5);
      const { page } = await standing(yielding);
      const now = await until('deviations', async () => {
        const found = await signs(page);
        return found.deviations.length > 0 ? found : null;
      });
      expect(now.deviations.every(({ compliant }) => compliant)).toBe(true);
      expect(now.ghostLinks).toEqual([]);
      expect(await labels(page)).toContain('apart-LSP: LSP compliant');
      await choose(page, { shown: 'both' });
      await until('a whole ghost', async () => (await signs(page)).ghostLinks.includes('Body_Torso'));
      await choose(page, { shown: 'pos', lens: false });
      await until('wrenches', async () => (await signs(page)).wrenches.length === 4);
      expect((await signs(page)).deviations).toEqual([]);
    },
  );
});

describe('limits', () => {
  it('set by the viewer change colour and shape at once, last a reload, and go back to the profile', async () => {
    const { source, page } = await robot();
    source.write(JSON.stringify(demoAt(1)));
    await shown(page);
    const foot = async () => (await signs(page)).wrenches.find(({ site }) => site === 'RF')?.force;
    const standsOn = await until('an arrow', async () => {
      const found = await foot();
      return found != null && found.size > 0 ? found : null;
    });
    expect(standsOn.level).toBe('ok');
    expect(standsOn.value).toBeGreaterThan(100);

    const openLimits = async () => {
      await page.findByRole('button', 'Settings').click();
      await until('limits', there(page, 'limits'));
      await page.evaluate(
        'for (const group of document.querySelectorAll(".limits details")) group.open = true',
      );
    };
    await openLimits();
    const high = '[data-testid="limit-ftf-RF.fz"] .number-field:nth-of-type(2) input';
    const type = (text: string) => enter(page, `document.querySelector(${JSON.stringify(high)})`, text);
    await type('100');
    await until('a fault', async () => (await foot())?.level === 'fault');
    expect(await page.evaluate(`document.querySelector('[data-sign="wrench-RF"]').dataset.level`)).toBe(
      'fault',
    );
    await type('-99');
    expect(await page.findByTestId('limits').text()).toContain(
      'The lower limit must be below the upper one.',
    );
    expect((await foot())?.level, 'what makes no sense changes nothing').toBe('fault');

    await page.reload();
    await shown(page);
    await until('the fault again', async () => (await foot())?.level === 'fault');
    await openLimits();
    await page.findByRole('button', 'Reset all to profile').click();
    await until('well again', async () => (await foot())?.level === 'ok');
    await page.press('Escape');
    await until('closed', gone(page, 'limits'));
  });
});

describe('load on the body', () => {
  it.skipIf(!FULL)(
    'paints links by temperature with a legend, and gives them their own colours back',
    async () => {
      const sample = demoAt(30);
      const { source, page } = await standing({
        ...sample,
        temp: { ...sample.temp, RKN: 71, LKN: 45, LHP: null },
      });
      await choose(page, { load: 'temp' });
      const painted = await until('colours', async () => {
        const { loads } = await signs(page);
        return FAULT.test(loads.Body_RKN ?? '') ? loads : null; // past its limit
      });
      expect(painted.Body_LHP, 'no reading').toBe('#7f8894');
      expect(painted.Body_LKN).not.toBe(painted.Body_RKN);
      expect(await page.findByTestId('load-legend').text()).toContain('70 °C');
      source.write(JSON.stringify(sample));
      await until('cool', async () => !FAULT.test((await signs(page)).loads.Body_RKN ?? ''));
      await choose(page, { load: 'off' });
      await until('own colours', async () => Object.keys((await signs(page)).loads).length === 0);
    },
  );
});

it.skipIf(!FULL)('all signs of an unchanged robot cost no pictures', async () => {
  const { page } = await standing(demoAt(42));
  await until('a ghost', async () => (await signs(page)).ghostLinks.length > 0);
  await until('HOLDING', is(page, 'HOLDING'));
  await until('the finest shells', () => finest(page));
  await drawsNothing(page, 10);
});

it('on a phone the feet stand above the buttons', async () => {
  const { source, page } = await robot();
  source.write(JSON.stringify(demoAt(1)));
  await page.viewport(PHONE);
  await page.reload();
  await shown(page);
  // The lowest point of the robot that can be picked, compared with the highest of the buttons.
  const clear = () =>
    page.evaluate<boolean>(`(() => {
      const tools = document.querySelector('.stage-tools')?.getBoundingClientRect();
      if (!tools) return false;
      const canvas = document.querySelector('[data-testid="scene"] canvas').getBoundingClientRect();
      for (let y = canvas.bottom - 2; y > canvas.top; y -= 2) {
        for (let x = canvas.left + 4; x < canvas.right; x += 6) {
          if (window.posecast.scene.pick(x, y) !== null) return y < tools.top;
        }
      }
      return false;
    })()`);
  await until('feet above the buttons', clear);
});
