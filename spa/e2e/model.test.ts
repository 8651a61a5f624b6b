import { readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { setTimeout as pause } from 'node:timers/promises';
import { describe, expect, it } from 'vitest';
import type { SampleModel } from '../tests/rigs/model_samples.ts';
import { type BuiltFiles, sampleChain, writeBuilt } from './built_model.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { body, gone, holds, renderedFrames, resting } from './robot_page.ts';
import { forwardKinematics, type Relay } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();
const CLOSE = 1e-6; // metres, and entries of a rotation
/** A white pixel. */
const PICTURE = Uint8Array.from(
  Buffer.from(
    'iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGP4DwABAQEAsTj2FAAAAABJRU5ErkJggg==',
    'base64',
  ),
);

const readings = (model: SampleModel, phase = 0): Record<string, number> =>
  Object.fromEntries(
    model.joints.flatMap(({ type, mimic }, i) =>
      type === 'fixed' || mimic !== undefined ? [] : [[`joint${i + 1}`, 0.9 * Math.sin(2.1 * i + phase)]],
    ),
  );

/** A page that shows the model in one pose, at rest, in its second level. `meanwhile`: started before the page opens. */
async function shown(
  relay: Relay,
  files: BuiltFiles,
  pos: Record<string, number>,
  robot = 'demo',
  meanwhile = () => {},
): Promise<Page> {
  stage.stack.builtEdge(relay, files, { pos }, robot);
  await until('on air', async () =>
    JSON.stringify(await relay.json('/api/v1/robots')).includes(`"${robot}"`),
  );
  meanwhile();
  const page = await stage.open(`${relay.url}/#/r/${robot}`);
  await until('a body', async () => Object.keys((await body(page))?.links ?? {}).length > 0);
  return page;
}

const asked = (page: Page, file: string) => page.requested.filter((url) => url.endsWith(`/${file}`)).length;

/** Draw calls of a picture in which only the camera has moved, so without the shadow. */
async function drawCalls(page: Page): Promise<number> {
  await until('framing has eased', () => resting(page));
  for (const side of ['front', 'side']) {
    const before = await renderedFrames(page);
    await page.findByRole('button', side).click();
    await until('a picture', async () => (await renderedFrames(page)) > before);
    await until('the camera has come to rest', () => resting(page));
  }
  return page.evaluate<number>('window.posecast.scene.drawCalls');
}

describe('a built model', () => {
  it('stands as forward kinematics says, from its manifest', async () => {
    const relay = await stage.stack.relay();
    const model = sampleChain(60);
    const files = await writeBuilt(stage.stack.folder(), model);
    const pos = readings(model);
    const page = await shown(relay, files, pos);
    await until('a reading', holds(page, 'window.posecast.twin.seq !== null'));
    // as transmitted, in steps of the wire format
    const joints = await page.evaluate<Record<string, number>>(
      `Object.fromEntries(${JSON.stringify(Object.keys(pos))}.map((j) => [j, window.posecast.twin.value('pos', j)]))`,
    );
    const expected = await forwardKinematics(files.urdf, joints);
    let apart = Number.NaN;
    await until('the pose', async () => {
      const links = (await body(page))?.links ?? {};
      const far = Object.entries(expected).flatMap(([link, pose]) =>
        pose.map((value, at) => Math.abs(value - (links[link]?.[at] ?? Number.NaN))),
      );
      apart = Math.max(...far);
      return apart <= CLOSE;
    });
    console.log(`${Object.keys(expected).length} links, ${(apart * 1e6).toFixed(4)} µm apart`);
  });

  it('comes coarse first, then finer by itself, and finest when asked', async () => {
    const relay = await stage.stack.relay();
    const files = await writeBuilt(stage.stack.folder(), sampleChain(12));
    const page = await shown(relay, files, readings(sampleChain(12)));
    await until('the second level', () => asked(page, 'middle.glb') === 1);
    expect([asked(page, 'low.glb'), asked(page, 'high.glb')]).toEqual([1, 0]);
    await page.findByRole('button', /^finer/).click();
    await until('the finest level', () => asked(page, 'high.glb') === 1);
    await until('no more to ask for', gone(page, 'finer'));
    expect(
      page.requested.some((url) => /raw_robot|ColladaLoader/.test(url)),
      'readers of raw files',
    ).toBe(false);
  });

  it.skipIf(!FULL)('is one draw call whatever its number of parts, one more for a picture', async () => {
    const relay = await stage.stack.relay();
    const counts: Record<string, number> = {};
    const few = sampleChain(2);
    const textured = {
      ...sampleChain(20),
      materials: [{}, {}, { picture: 0 }],
      pictures: [PICTURE],
    };
    for (const [name, model] of Object.entries({ two: few, sixty: sampleChain(60), textured })) {
      const files = await writeBuilt(stage.stack.folder(), model);
      const page = await shown(relay, files, readings(model), name);
      await until('skin', () => asked(page, 'middle.glb') === 1);
      counts[name] = await drawCalls(page);
      if (name === 'sixty') {
        await page.screenshot('built-model.png');
        const link = await page.evaluate<string | null>(`(() => {
          const { left, top, width, height } = document.querySelector('canvas').getBoundingClientRect();
          for (let i = 0; i < 400; i++) {
            const found = window.posecast.scene.pick(left + width * (0.3 + 0.02 * (i % 20)), top + height * (0.3 + 0.02 * Math.floor(i / 20)));
            if (found !== null) return found;
          }
          return null;
        })()`);
        expect(link).toMatch(/^(base|link\d+)$/);
        const before = await renderedFrames(page);
        await page.evaluate(`window.posecast.scene.setLinkLook('${link}', { highlight: 1, fade: 0.5 })`);
        await page.evaluate(`window.posecast.scene.setLinkLook('base', { hide: true })`);
        await until('a picture', async () => (await renderedFrames(page)) > before);
        expect(await drawCalls(page)).toBe(counts.sixty);
      }
      await page.evaluate(`window.posecast.scene.showGhost({ names: ['joint1'], values: [1.2] })`);
      expect(await drawCalls(page), 'a ghost is one more').toBe((counts[name] ?? 0) + 1);
      if (name === 'sixty') await page.screenshot('built-model-ghost.png');
      await page.evaluate('window.posecast.scene.showGhost(null)');
      expect(await drawCalls(page)).toBe(counts[name]);
      await page.close();
    }
    console.log(`draw calls in all: ${JSON.stringify(counts)}`);
    expect(counts.sixty).toBe(counts.two);
    expect(counts.textured).toBe((counts.two ?? 0) + 1);
  });

  it('is fetched once, also when another robot wears the same shells', async () => {
    const relay = await stage.stack.relay();
    const model = sampleChain(12);
    const files = await writeBuilt(stage.stack.folder(), model, ['low']);
    const page = await shown(relay, files, readings(model), 'first');
    await until('skin', async () => (await page.evaluate<number>('window.posecast.scene.triangles')) > 0);
    stage.stack.builtEdge(relay, files, { pos: readings(model) }, 'second');
    await until('both', async () => JSON.stringify(await relay.json('/api/v1/robots')).includes('second'));
    await until(
      'kept',
      holds(page, `caches.open('posecast-levels-1').then(async (c) => (await c.keys()).length === 1)`),
    );
    await page.open(`${relay.url}/#/r/second`);
    await until('a body', async () => Object.keys((await body(page))?.links ?? {}).length > 0);
    await until('the manifest', () => asked(page, 'manifest.json') === 2);
    await pause(500);
    expect(asked(page, 'low.glb')).toBe(1);
  });

  it('with shells that are not what was announced moves as a skeleton and says why', async () => {
    const relay = await stage.stack.relay();
    const model = sampleChain(12);
    const files = await writeBuilt(stage.stack.folder(), model, ['low']);
    const low = path.join(files.folder, 'low.glb');
    const page = await shown(relay, files, readings(model), 'demo', () =>
      writeFileSync(low, readFileSync(low).fill(0x3c, 40, 60)),
    );
    page.forgive(/Failed to load resource/); // the relay refuses it first because of its hash
    await until('a reason', async () =>
      (await page.text()).includes('Only the skeleton can be shown: low.glb'),
    );
  });
});
