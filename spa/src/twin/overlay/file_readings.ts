import { parseSchema } from '@posecast/wire';
import type { OverlayReadings } from './reader.ts';

/** The schema of a robot that reports nothing: the reader of balance finds no sensor in it. */
const SCHEMA = parseSchema(
  JSON.stringify({
    ...{ type: 'schema', v: 1, robot: 'files', labels: { joint: ['joint'] } },
    fields: [{ name: 'pos', labels: 'joint' }],
  }),
);

/** What can be drawn about a robot that is shown from its files alone: the balance, by its masses. */
export const FILE_READINGS: OverlayReadings = {
  ...{ wrenches: [], deviations: [], imus: [], body: null, based: false, loads: null },
  balance: { schema: SCHEMA, choice: 'on', limits: null, joints: [], anchored: false },
};
