/** Compares the pose in the page with the pose sent by the robot's edge. */

import { expect } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import type { Process } from './process.ts';
import { type Body, body, resting, whole } from './robot_page.ts';
import { forwardKinematics, type Tap, type TappedFrame } from './stack.ts';

const ONE_MM = 0.001;

/** Stops the robot's edge and waits until page, scene and tap have its last frame. */
async function frozen(page: Page, edge: Process, tap: Tap): Promise<{ shown: Body; sent: TappedFrame }> {
  // First waits for its meshes: without them, it stands on what has loaded so far, and a stopped edge sends no more.
  await until('the body is whole', () => whole(page));
  page.forgive(/status of 503/); // a part of its model that the page is just requesting can't be had from a stopped edge
  edge.signal('SIGSTOP');
  let before = '';
  // All values equal twice in a row: on a busy machine page and tap may both be late, and the body is played with a delay.
  const shown = await until('page, body and tap stand at its last frame', async () => {
    const rests = await resting(page);
    const now = await body(page);
    const last = before;
    before = JSON.stringify(now);
    const there = now !== null && Object.keys(now.links).length > 0 && now.seq === tap.newest?.seq;
    return rests && there && before === last ? now : null;
  });
  const sent = await until('the tap has the frame', () => tap.frame(shown.seq));
  edge.signal('SIGCONT');
  return { shown, sent };
}

function baseOf(frame: TappedFrame): unknown {
  const { base, baseq } = frame.values;
  if (base === undefined || baseq === undefined) return null;
  return { xyz: Object.values(base), quat_wxyz: Object.values(baseq) };
}

/** The largest distance between a link's origin here and there, and the largest difference of any rotation entry. */
function apart(
  shown: Body,
  expected: Readonly<Record<string, number[]>>,
): { metres: number; rotation: number } {
  let metres = 0;
  let rotation = 0;
  for (const [link, pose] of Object.entries(expected)) {
    const seen = shown.links[link];
    if (seen === undefined) throw new Error(`the scene has no link ${link}`);
    const moved = [3, 7, 11].map((at) => (seen[at] ?? Number.NaN) - (pose[at] ?? Number.NaN));
    metres = Math.max(metres, Math.hypot(...moved));
    for (const at of [0, 1, 2, 4, 5, 6, 8, 9, 10]) {
      rotation = Math.max(rotation, Math.abs((seen[at] ?? Number.NaN) - (pose[at] ?? Number.NaN)));
    }
  }
  return { metres, rotation };
}

/** Holds the robot in one frame and compares every link with independent forward kinematics; returns the frame's number. */
export async function poseMatches(page: Page, edge: Process, tap: Tap, urdf: string): Promise<number> {
  const { shown, sent } = await frozen(page, edge, tap);
  const { metres, rotation } = apart(shown, await forwardKinematics(urdf, sent.joints, baseOf(sent)));
  expect(metres, `links of frame ${sent.seq}, metres apart`).toBeLessThanOrEqual(ONE_MM);
  expect(rotation, `links of frame ${sent.seq}, rotation apart`).toBeLessThanOrEqual(ONE_MM);
  console.log(
    `frame ${sent.seq}: ${Object.keys(shown.links).length} links, ${(metres * 1000).toFixed(4)} mm apart`,
  );
  return sent.seq;
}
