/** Draw calls counted at the graphics interface, compared with three.js's own count. */

import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { renderedFrames, resting } from './robot_page.ts';

export interface DrawCalls {
  /** Of the whole picture. */
  readonly all: number;
  /** For everything drawn with bones: the robot, and its ghost. */
  readonly bones: number;
  /** Colours of the picture, if the page fills its pixels. */
  readonly colors?: number;
}

/** Runs before the page's own scripts: counts the calls of each picture. */
export const COUNT_DRAWS = `(() => {
  let now = { all: 0, bones: 0 };
  window.pictures = [];
  const known = new WeakMap();
  const hasBones = (gl) => {
    const program = gl.getParameter(gl.CURRENT_PROGRAM);
    if (!known.has(program)) known.set(program, gl.getUniformLocation(program, 'bones') !== null);
    return known.get(program);
  };
  const gl = WebGL2RenderingContext.prototype;
  for (const name of ['drawArrays', 'drawElements', 'drawRangeElements', 'drawArraysInstanced', 'drawElementsInstanced']) {
    const draw = gl[name];
    gl[name] = function (...how) {
      if (now.all++ === 0) queueMicrotask(() => close(this));
      if (hasBones(this)) now.bones++;
      return draw.apply(this, how);
    };
  }
  const close = (gl) => {
    if (window.painting) {
      const pixels = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
      gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      now.colors = new Set(new Uint32Array(pixels.buffer)).size;
    }
    window.pictures.push(now);
    if (window.pictures.length > 50) window.pictures.shift();
    now = { all: 0, bones: 0 };
  };
})()`;

/** The draw calls of a picture in which only the camera has moved, so that the shadow is not redrawn. The robot must stand
 *  still. */
export async function drawCalls(page: Page): Promise<DrawCalls & { three: number }> {
  for (const side of ['front', 'side']) {
    const before = await renderedFrames(page);
    await page.findByRole('button', new RegExp(`^${side}$`)).click();
    await until('a picture', async () => (await renderedFrames(page)) > before);
    await until('the camera has come to rest', () => resting(page));
  }
  return page.evaluate('({ ...window.pictures.at(-1), three: window.posecast.scene.drawCalls })');
}
