import { strToU8, zipSync } from 'fflate';
import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const URDF = `<robot name="arm"><link name="base"><visual><geometry><box size="0.2 0.2 0.2"/></geometry></visual></link>
<link name="rod"><visual><geometry><mesh filename="package://arm/meshes/rod.stl"/></geometry></visual></link>
<joint name="lift" type="prismatic"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/>
<limit lower="0" upper="0.5" effort="1" velocity="1"/></joint></robot>`;

/** Puts a file into an input the way a person's choice does. */
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
    const relay = await stage.stack.relay();
    const page = await stage.newPage();
    await page.open(`${relay.url}/#/`);
    await until('the list', async () => (await page.findByTestId('choose-zip').count()) === 1);
    await page.evaluate(choose('choose-zip', zipSync({ 'arm/arm.urdf': strToU8(URDF) }), 'arm.zip'));
    const links = () => page.evaluate<Record<string, number[]>>('window.posecast.scene?.linkPoses() ?? {}');
    await until('a body', async () => Object.keys(await links()).length === 2, 30_000);
    expect(await page.text()).toContain('The mesh package://arm/meshes/rod.stl is not among the files.');
    const height = async () => ((await links()).rod?.[11] ?? 0) - ((await links()).base?.[11] ?? 0);
    expect(await height()).toBe(0);
    await page.evaluate(`(() => {
      const slider = document.querySelector('.local-slider input');
      Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(slider, '0.25');
      slider.dispatchEvent(new Event('input', { bubbles: true }));
    })()`);
    await until('the rod lifts', async () => Math.abs((await height()) - 0.25) < 1e-9);
    const strange = page.requested.filter((url) => !/\/$|\/#|assets\/|favicon|api\/v1\/robots$/.test(url));
    expect(strange).toEqual([]);
    await page.findByRole('button', 'Close this robot').click();
    await until('the list again', async () => (await page.findByTestId('choose-zip').count()) === 1);
    await page.evaluate(choose('choose-zip', strToU8('no zip'), 'x.zip'));
    await until('a reason', async () => (await page.text()).includes('This is no zip.'));
  });
});
