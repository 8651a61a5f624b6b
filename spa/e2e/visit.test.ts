import { mkdirSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { engineName } from './driver/engines.ts';
import { until } from './driver/until.ts';
import { hasSkin, resting, whole } from './robot_page.ts';
import { DEMO, demoAt } from './sign_words.ts';
import { FULL, setStage } from './stage.ts';

interface Look {
  readonly joint: string;
  /** What is at the joint's position in the picture: its limb, or another link by name; null: nothing. */
  readonly met: string | null;
  /** The distance of the eye from its previous position, metres: while the joint is selected, and after Escape. */
  readonly went: number;
  readonly left: number;
}

/** Selects each joint in the table that the model has, or every n-th, and closes its card with Escape. The results are in
 *  `window.looks`. */
const look = (each: number) => `void (async () => {
  const { scene } = window.posecast;
  const canvas = document.querySelector('[data-testid="scene"] canvas');
  const tree = scene.tree();
  const card = () => document.querySelector('[data-testid="joint-card"]') !== null;
  const until = async (holds, most) => {
    for (let i = 0; i < most && !holds(); i += 1) await new Promise(requestAnimationFrame);
  };
  const apart = (a, b) => Math.hypot(...a.map((value, i) => value - b[i]));
  const originOf = (link) => [3, 7, 11].map((i) => scene.linkPoses()[link][i]);
  // the links between two joints of one limb; links that carry several limbs are the trunk
  const carried = (link) => tree.joints.filter((joint) => tree.bodyOf(tree.before(joint) ?? '').includes(link)).length;
  const first = scene.eye.position;
  const looks = [];
  const rows = [...document.querySelectorAll('tr[data-label]')].filter(({ dataset }) => tree.linkOf(dataset.label) !== null);
  for (const [i, row] of rows.entries()) {
    if (i % ${each} > 0) continue;
    const joint = row.dataset.label;
    const link = tree.linkOf(joint);
    const before = scene.renderedFrames;
    row.querySelector('button').click();
    const off = () => apart(originOf(link), scene.eye.target);
    await until(() => card() && scene.renderedFrames > before && off() < 1e-6, 200);
    const { position, target } = scene.eye;
    const { left, top, width } = canvas.getBoundingClientRect();
    const { projection } = scene.rig; // the target is in the middle of the uncovered area
    const hit = scene.pick(left + width / 2, top + projection.top + projection.free / 2);
    const limb = tree.bodyOf(tree.before(joint) ?? '').filter((near) => carried(near) < 2);
    const here = Object.keys(scene.linkPoses()).filter((near) => apart(originOf(near), target) < 0.01);
    const own = hit !== null && [...limb, ...tree.bodyOf(joint), ...here].includes(hit);
    const went = apart(position, first);
    dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape' }));
    await until(() => !card(), 200);
    looks.push({ joint, met: apart(originOf(link), target) > 1e-6 ? 'elsewhere, by ' + apart(originOf(link), target) : own ? 'its limb' : hit, went, left: apart(scene.eye.position, first) });
  }
  window.looks = looks;
})()`;

describe.each([
  ['3D', {}, FULL ? 1 : 4], // software rendering takes seconds for a picture in 3D
  ['the light view', { webgl: false }, 1],
] as const)('a selected joint in %s', (name, options, each) => {
  const stage = setStage(options);

  it('is in the middle and hidden by no other limb and no trunk; Escape takes the camera back', async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, demoAt(1), DEMO);
    const page = await stage.newPage({ media: { motion: 'reduce' }, viewport: { width: 1100, height: 480 } });
    page.forgive(/WebGL/); // the browser's own error when a context is requested
    await page.open(`${relay.url}/#/r/demo`);
    await until('a body', async () => (await hasSkin(page)) && (await whole(page)));
    await until('a table', () => page.evaluate<boolean>(`document.querySelector('tr[data-label]') !== null`));
    await until('its right side, where the trunk hides the left arm', async () => {
      await page.press('2'); // the camera's keys load after the body
      return page.evaluate<boolean>(`(() => {
        const { position, target } = window.posecast.scene.eye;
        return Math.abs(position[0] - target[0]) < 0.01;
      })()`);
    });
    await page.evaluate(look(each));
    const looks = await until('all looks', () => page.evaluate<Look[] | null>('window.looks ?? null'));
    expect(looks.length).toBeGreaterThan(20 / each);
    for (const { joint, met, went, left } of looks) {
      expect(met, joint).toBe('its limb');
      expect(went, joint).toBeGreaterThan(0.5);
      expect(left, joint).toBeLessThan(1e-3);
    }
    await page.evaluate(`document.querySelector('tr[data-label="LSP"] button').click()`);
    await until('the eye rests', () => resting(page));
    const shots = path.join(import.meta.dirname, 'shots');
    mkdirSync(shots, { recursive: true });
    await page.screenshot(path.join(shots, `visit-${name.replaceAll(' ', '-')}-${engineName()}.png`));
    await page.evaluate('window.posecast.scene.orbit(0.2, 0)');
    const turned = await page.evaluate<string>('JSON.stringify(window.posecast.scene.eye)');
    await page.press('Escape');
    await until('the card closed', () =>
      page.evaluate<boolean>(`document.querySelector('[data-testid="joint-card"]') === null`),
    );
    expect(await page.evaluate<string>('JSON.stringify(window.posecast.scene.eye)'), 'a hand moved it').toBe(
      turned,
    );
  });
});
