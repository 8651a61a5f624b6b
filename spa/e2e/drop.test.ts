import { mkdirSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { strToU8, zipSync } from 'fflate';
import { describe, expect, it } from 'vitest';
import { binaryStl, collada, cubeSoup, MTL, OBJ, triangleGlb } from '../tests/rigs/mesh_samples.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { enter, holds, there } from './robot_page.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const URDF = `<robot name="arm"><link name="base"><visual><geometry><box size="0.2 0.2 0.2"/></geometry></visual></link>
<link name="rod"><visual><geometry><mesh filename="package://arm/meshes/rod.stl"/></geometry></visual></link>
<joint name="lift" type="prismatic"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/>
<limit lower="0" upper="0.5" effort="1" velocity="1"/></joint></robot>`;

/** A mesh of a rod, 1 m long. */
const ROD = binaryStl(cubeSoup());

const rods = (page: Page) =>
  page.evaluate<number>(
    `Object.keys(window.posecast.scene?.linkPoses() ?? {}).filter((name) => name === 'rod').length`,
  );

const chooses = (page: Page) => until('the list', there(page, 'choose-zip'));

const opened = stage.share(async (stack, newPage) => {
  const relay = await stack.relay();
  return { relay, page: await newPage() };
});

/** A page that shows the list. */
async function listed(): Promise<Page> {
  const { relay, page } = await opened();
  await page.viewport({ width: 1280, height: 800 });
  await page.open('about:blank');
  await page.open(`${relay.url}/#/`);
  await chooses(page);
  return page;
}

/** Leaves the robot and returns to the list. */
async function closed(page: Page): Promise<void> {
  await page.findByRole('button', 'Close this robot').click();
  await chooses(page);
}

/** Puts a file into an input as if a person had chosen it. */
const choose = (id: string, bytes: Uint8Array, name: string): string => `(() => {
  const bytes = Uint8Array.from(atob('${Buffer.from(bytes).toString('base64')}'), (c) => c.charCodeAt(0));
  const chosen = new DataTransfer();
  chosen.items.add(new File([bytes], '${name}'));
  const input = document.querySelector('[data-testid="${id}"]');
  input.files = chosen.files;
  input.dispatchEvent(new Event('change', { bubbles: true }));
})()`;

describe("a robot from one's own computer", () => {
  it('is shown with sliders and what is wrong with it, and nothing is sent', async () => {
    const page = await listed();
    await page.evaluate(choose('choose-zip', zipSync({ 'arm/arm.urdf': strToU8(URDF) }), 'arm.zip'));
    const links = () => page.evaluate<Record<string, number[]>>('window.posecast.scene?.linkPoses() ?? {}');
    await until('a body', async () => Object.keys(await links()).length === 2);
    expect(await page.text()).toContain(
      "mesh 'package://arm/meshes/rod.stl' of link 'rod': no such file; looked for any 'rod.stl' in the robot's folder · line 2",
    );
    const height = async () => ((await links()).rod?.[11] ?? 0) - ((await links()).base?.[11] ?? 0);
    expect(await height()).toBe(0);
    await enter(page, `document.querySelector('.local-slider input')`, '0.25');
    await until('the rod lifts', async () => Math.abs((await height()) - 0.25) < 1e-9);
    const strange = page.requested.filter(
      (url) => !/\/$|\/#|assets\/|favicon|config\.json$|api\/v1\/robots$/.test(url),
    );
    expect(strange).toEqual([]);
    await closed(page);
    await page.evaluate(choose('choose-zip', strToU8('no zip'), 'x.zip'));
    await until('a reason', async () => (await page.text()).includes('This is not a zip file.'));
  });

  it('has its centre of mass, which follows the sliders; in one line what can not be known', async () => {
    const weighing = (kg: string, centre = '0 0 0') =>
      URDF.replaceAll(/<link name="(base|rod)">/g, (link, name) => {
        const mass = name === 'rod' ? kg : '3';
        return `${link}<inertial><origin xyz="${centre}"/><mass value="${mass}"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>`;
      });
    const page = await listed();
    const open = (...weight: Parameters<typeof weighing>) =>
      page.evaluate(choose('choose-zip', zipSync({ 'arm.urdf': strToU8(weighing(...weight)) }), 'arm.zip'));
    const ball = () =>
      page.evaluate<number[] | null>('window.posecast.scene?.signs.balance?.centreOfMass ?? null');
    const entry = () => page.findByTestId('local-balance').text();
    await open('1');
    await until('the ball', async () => (await ball()) !== null);
    const low = (await ball())![2]!;
    await enter(page, `document.querySelector('.local-slider input')`, '0.4');
    await until('a quarter of the way', async () => Math.abs((await ball())![2]! - low - 0.1) < 1e-6);
    expect(await entry()).toMatch(/^Balance\s*This model is shown straight from its files/);
    await page.screenshot('drop-balance.png');
    await page.evaluate(`document.querySelector('[data-testid="local-balance"] input').click()`);
    await until('no ball', async () => (await ball()) === null);
    await page.evaluate(`document.querySelector('[data-testid="local-balance"] input').click()`);
    await until('the ball again', async () => (await ball()) !== null);
    await closed(page);
    await open('nan');
    await until('the reason', async () => (await page.text()).includes("'nan'; no balance is shown"));
    await until('the entry', async () => (await entry()).includes('impossible masses'));
    expect(await ball()).toBeNull();
    await closed(page);
    await open('1', '0 0 -200'); // millimetres
    const far = "link 'rod': a centre of mass 200 m away (millimetres?); no balance is shown";
    await until('the links that are far', async () => (await page.text()).includes(far));
    await until('the entry', async () => (await entry()).includes('impossible masses'));
    expect(await ball()).toBeNull();
  });

  it('shows every kind of mesh, and any of several robots', async () => {
    const mesh = (name: string, kind: string, y: number) =>
      `<link name="${name}"><visual><geometry><mesh filename="package://zoo/meshes/${kind}"/></geometry></visual></link>
${name === 'base' ? '' : `<joint name="to_${name}" type="continuous"><parent link="base"/><child link="${name}"/><origin xyz="0 ${y} 0"/><axis xyz="0 0 1"/></joint>`}`;
    const zoo = `<robot name="zoo">
${mesh('base', 'a.STL', 0)}
${mesh('collada', 'b.dae', 1.5)}
${mesh('wavefront', 'c.obj', 3)}
${mesh('binary', 'd.glb', 4.5)}
<link name="__proto__"/><link name="&lt;img src=x onerror=alert(1)&gt;"/>
</robot>`;
    const zip = zipSync({
      'zoo/zoo.urdf': strToU8(zoo),
      'zoo/parts/arm.urdf': strToU8(URDF),
      'zoo/meshes/a.STL': binaryStl(cubeSoup()),
      'zoo/meshes/b.dae': collada(),
      'zoo/meshes/c.obj': strToU8(OBJ),
      'zoo/meshes/paints.mtl': strToU8(MTL),
      'zoo/meshes/d.glb': triangleGlb(),
      '../../outside.urdf': strToU8(URDF),
    });
    const page = await listed();
    await page.evaluate(choose('choose-zip', zip, 'zoo.zip'));
    const links = () => page.evaluate<string[]>('Object.keys(window.posecast.scene?.linkPoses() ?? {})');
    await until('a body', async () => (await links()).includes('binary'));
    const read = "mesh 'package://zoo/meshes/b.dae': it says Y_UP; ignored, as RViz does";
    await until('every mesh has been read', async () => (await page.text()).includes(read));
    const text = await page.text();
    expect(text).toContain("link '<img src=x onerror=alert(1)>'");
    expect(text).not.toMatch(/no such file|of link '(base|collada|wavefront|binary)'/);
    await page.screenshot('drop-zoo.png');
    await page.viewport({ width: 390, height: 844 });
    await until('room', holds(page, 'document.body.scrollWidth <= 390'));
    await page.screenshot('drop-zoo-phone.png');
    expect(
      await page.evaluate<string[]>(`[...document.querySelectorAll('option')].map((o) => o.value)`),
    ).toEqual(['zoo/zoo.urdf', 'zoo/parts/arm.urdf']);
    await page.evaluate(`(() => {
      const choice = document.querySelector('[data-testid="choose-urdf"]');
      choice.value = 'zoo/parts/arm.urdf';
      choice.dispatchEvent(new Event('change', { bubbles: true }));
    })()`);
    await until('the other robot', async () => (await links()).includes('rod'));
  });

  it('may be dropped: a folder as it lies on the desktop, or a zip', async (context) => {
    stage.needs(context, 'files');
    const page = await listed();
    const top = path.join(stage.stack.folder(), 'arm');
    for (const folder of ['urdf', 'meshes']) mkdirSync(path.join(top, folder), { recursive: true });
    writeFileSync(path.join(top, 'urdf/arm.urdf'), URDF);
    writeFileSync(path.join(top, 'meshes/rod.stl'), ROD);
    // browsers return a folder's entries in groups of a hundred
    for (let i = 0; i < 130; i++) writeFileSync(path.join(top, `meshes/spare${i}.stl`), '');
    const zip = path.join(top, '..', 'arm.zip');
    writeFileSync(zip, zipSync({ 'arm/arm.urdf': strToU8(URDF), 'arm/meshes/rod.stl': ROD }));
    for (const what of FULL ? [top, zip] : [top]) {
      await page.dropFiles({ x: 640, y: 300 }, [what]);
      await until(`a body of ${what}`, async () => (await rods(page)) === 1);
      await until('all of it', async () => (await page.text()).includes('No problems found.'));
      await closed(page);
    }
  });

  it('may come from a program that has files and no folders', async () => {
    const page = await listed();
    await page.evaluate(`(() => {
      const dropped = new DataTransfer();
      dropped.items.add(new File([${JSON.stringify(URDF)}], 'arm.urdf'));
      const how = { dataTransfer: dropped, bubbles: true, cancelable: true };
      document.body.dispatchEvent(new DragEvent('dragover', how));
      document.body.dispatchEvent(new DragEvent('drop', how));
    })()`);
    await until('a body', async () => (await rods(page)) === 1);
  });

  it('is told what its meshes say when they have been read: their size, and why one is not shown', async () => {
    const page = await listed();
    const millimetres = binaryStl(cubeSoup().map((value) => 300 * value));
    const large = zipSync({ 'arm/arm.urdf': strToU8(URDF), 'arm/meshes/rod.stl': millimetres });
    await page.evaluate(choose('choose-zip', large, 'large.zip'));
    await until('its size', async () => (await page.text()).includes('the robot measures 300 m'));
    expect(await page.text()).toContain(
      `link 'rod': its mesh is 300 m long: millimetres? scale="0.001 0.001 0.001" · line 2`,
    );
    if (!FULL) return;
    await closed(page);
    const wrong = strToU8('<!doctype html><html><body>Not found</body></html>');
    const broken = zipSync({ 'arm/arm.urdf': strToU8(URDF), 'arm/meshes/rod.stl': wrong });
    await page.evaluate(choose('choose-zip', broken, 'broken.zip'));
    const why = `mesh 'package://arm/meshes/rod.stl' of link 'rod': an HTML page, not a mesh: a server answered with a page · line 2`;
    await until('why', async () => (await page.text()).includes(why));
  });

  it('may be a folder; a bomb is refused with a reason', async () => {
    const page = await listed();
    await page.evaluate(`(() => {
      const file = new File([${JSON.stringify(URDF)}], 'arm.urdf');
      Object.defineProperty(file, 'webkitRelativePath', { value: 'arm/urdf/arm.urdf' });
      const input = document.querySelector('[data-testid="choose-folder"]');
      Object.defineProperty(input, 'files', { value: [file] });
      input.dispatchEvent(new Event('change', { bubbles: true }));
    })()`);
    await until('a body', holds(page, `Object.keys(window.posecast.scene?.linkPoses() ?? {}).length === 2`));
    await closed(page);
    const bomb = zipSync({ 'a.stl': new Uint8Array(60_000_000) });
    await page.evaluate(
      '[(window.before = performance.memory?.usedJSHeapSize ?? 0), (window.began = performance.now())]',
    );
    await page.evaluate(choose('choose-zip', bomb, 'bomb.zip'));
    await until('a reason', async () => (await page.text()).includes('unpacks to too much data, at a.stl'));
    const cost = await page.evaluate<{ ms: number; mb: number }>(
      '({ ms: performance.now() - window.began, mb: ((performance.memory?.usedJSHeapSize ?? 0) - window.before) / 1e6 })',
    );
    console.log(
      `a bomb of 60 MB in ${bomb.length} bytes: refused after ${cost.ms.toFixed(0)} ms, ${cost.mb.toFixed(1)} MB of heap`,
    );
    expect(cost.mb).toBeLessThan(50); // Chromium's message; the others report none
  });
});
