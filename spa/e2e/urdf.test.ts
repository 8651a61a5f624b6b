import { writeFileSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { body, there } from './robot_page.ts';
import { buildModel, canBuild } from './shared_robots.ts';
import { forwardKinematics } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();
const ONE_MM = 0.001;

const box = (name: string) =>
  `<link name="${name}"><visual><geometry><box size="0.3 0.2 0.1"/></geometry></visual></link>`;
const joint = (name: string, type: string, parent: string, child: string, more = '') =>
  `<joint name="${name}" type="${type}"><parent link="${parent}"/><child link="${child}"/>${more}</joint>`;
const robot = (...parts: string[]) => `<robot name="free">\n${parts.join('\n')}\n</robot>\n`;
const at = (xyz: string, rpy = '0 0 0') => `<origin xyz="${xyz}" rpy="${rpy}"/>`;
const axis = (xyz: string) => `<axis xyz="${xyz}"/>`;
const END = '<limit lower="-9" upper="9" effort="1" velocity="1"/>';

const TILT = joint('tilt', 'revolute', 'drone', 'rod', `${at('0 0 0.2')}${axis('0 1 0')}`);
/** A cart on a sloping floor, a slide on an upright wall of it, a drone that flies beside it. */
const FREE = robot(
  ...['base', 'cart', 'slide', 'drone', 'rod'].map(box),
  joint('drive', 'planar', 'base', 'cart', `${at('0 0 0.1', '0.2 0 0.5')}${axis('0 0 1')}`),
  joint('wall', 'planar', 'cart', 'slide', `${at('0.3 0 0')}${axis('0 1 0')}`),
  joint('fly', 'floating', 'base', 'drone', at('0 0.5 0.5', '0 0 1')),
  TILT,
);
/** The same with single-variable joints, which every library supports; `pitch` in rad, as in `rot_y` and `rot_w`. */
const plain = (pitch: number) =>
  robot(
    ...['base', 'cart', 'slide', 'drone', 'rod', 'd1', 'd2', 'w1', 'w2', 'f1', 'f2', 'f3'].map(box),
    joint('drive/x', 'prismatic', 'base', 'd1', `${at('0 0 0.1', '0.2 0 0.5')}${axis('1 0 0')}${END}`),
    joint('drive/y', 'prismatic', 'd1', 'd2', `${axis('0 1 0')}${END}`),
    joint('drive/theta', 'continuous', 'd2', 'cart', axis('0 0 1')),
    // the plane across y: x and y after the shortest rotation from z to y
    joint('wall/x', 'prismatic', 'cart', 'w1', `${at('0.3 0 0')}${axis('1 0 0')}${END}`),
    joint('wall/y', 'prismatic', 'w1', 'w2', `${axis('0 0 -1')}${END}`),
    joint('wall/theta', 'continuous', 'w2', 'slide', axis('0 1 0')),
    joint('fly/trans_x', 'prismatic', 'base', 'f1', `${at('0 0.5 0.5', '0 0 1')}${axis('1 0 0')}${END}`),
    joint('fly/trans_y', 'prismatic', 'f1', 'f2', `${axis('0 1 0')}${END}`),
    joint('fly/trans_z', 'prismatic', 'f2', 'f3', `${axis('0 0 1')}${END}`),
    joint('turned', 'fixed', 'f3', 'drone', at('0 0 0', `0 ${pitch} 0`)),
    TILT,
  );
const POS = {
  'drive/x': 0.4,
  'drive/y': -0.3,
  'drive/theta': 0.7,
  'wall/x': 0.2,
  'wall/y': 0.1,
  'wall/theta': -1.1,
  'fly/trans_x': 0.5,
  'fly/trans_y': 0.25,
  'fly/trans_z': 0.75,
  'fly/rot_x': 0,
  'fly/rot_y': Math.sin(0.4),
  'fly/rot_z': 0,
  'fly/rot_w': Math.cos(0.4),
  tilt: 0.6,
};

function written(urdf: string): string {
  const file = path.join(stage.stack.folder(), 'robot.urdf');
  writeFileSync(file, urdf);
  return file;
}

/** A page with the list and the robot on air, in the pose POS: as a built model, or from its raw URDF. */
async function listed(built = true): Promise<Page> {
  const urdf = written(FREE);
  const relay = await stage.stack.relay();
  if (built) {
    const folder = stage.stack.folder();
    buildModel(urdf, folder);
    stage.stack.builtEdge(relay, { folder }, { pos: POS }, 'free');
  } else {
    stage.stack.fedEdge(relay, { pos: POS }, { robot: 'free', urdf, meshTools: false });
  }
  const page = await stage.open(`${relay.url}/#/`);
  await until('it is listed', there(page, 'robot-free'));
  return page;
}

describe('a URDF', () => {
  it.skipIf(!canBuild())(
    'that was built has its picture in the list, and on its page what is wrong with it',
    async () => {
      const page = await listed();
      const picture = await until('its picture', () =>
        page.evaluate<{ width: number; height: number } | null>(`(() => {
        const image = document.querySelector('[data-testid="thumbnail"]');
        return image?.complete && image.naturalWidth > 0 ? { width: image.naturalWidth, height: image.naturalHeight } : null;
      })()`),
      );
      expect(Math.min(picture.width, picture.height)).toBeGreaterThanOrEqual(64);
      await page.findByTestId('robot-free').click();
      const line = page.findByTestId('model-findings');
      await until('the line', async () => (await line.count()) === 1);
      expect(await line.text()).toMatch(/^1 finding/);
      expect(await line.visible()).toBe(false);
      await page.evaluate(`document.querySelector('.notices > button').click()`);
      await until('opened', () => line.visible());
      expect(await line.text()).toContain("joint 'tilt' is revolute and has no <limit> · line 10");
    },
  );

  it.skipIf(!canBuild())('that was built moves planar and floating joints as joints of one value would', () =>
    moves(true),
  );

  it('as it is moves them just so', () => moves(false));

  async function moves(built: boolean): Promise<void> {
    const page = await listed(built);
    await page.findByTestId('robot-free').click();
    const shown = await until('a reading of each', () =>
      page.evaluate<Record<string, number> | null>(`(() => {
          const shown = Object.fromEntries(${JSON.stringify(Object.keys(POS))}.map((name) => [name, window.posecast?.twin?.value('pos', name)]));
          return Object.values(shown).every((value) => typeof value === 'number') ? shown : null;
        })()`),
    );
    for (const [name, value] of Object.entries(POS)) expect(shown[name], name).toBeCloseTo(value, 2);
    const pitch = 2 * Math.atan2(shown['fly/rot_y'] ?? NaN, shown['fly/rot_w'] ?? NaN);
    const root = { xyz: [0, 0, 0], quat_wxyz: [1, 0, 0, 0] };
    const expected = await forwardKinematics(written(plain(pitch)), shown, root);
    let apart = Number.NaN;
    await until(`every link within ${ONE_MM} m`, async () => {
      const links = (await body(page))?.links ?? {};
      const lift = (links.base?.[11] ?? Number.NaN) - (expected.base?.[11] ?? Number.NaN); // it stands on the floor
      const far = ['base', 'cart', 'slide', 'drone', 'rod'].flatMap((link) =>
        (expected[link] ?? []).map((value, i) =>
          Math.abs(value + (i === 11 ? lift : 0) - (links[link]?.[i] ?? Number.NaN)),
        ),
      );
      apart = Math.max(...far);
      return apart <= ONE_MM;
    });
    console.log(`planar and floating, ${built ? 'built' : 'as it is'}: ${(apart * 1e6).toFixed(1)} µm apart`);
  }
});
