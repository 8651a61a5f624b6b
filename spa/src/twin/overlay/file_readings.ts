import { parseSchema } from '@posecast/wire';
import type { OverlayReadings } from './reader.ts';

/** The schema of a robot that reports nothing: the balance reader finds no sensor in it. */
const SCHEMA = parseSchema(
  JSON.stringify({
    ...{ type: 'schema', v: 1, robot: 'files', labels: { joint: ['joint'] } },
    fields: [{ name: 'pos', labels: 'joint' }],
  }),
);

/** The overlay data of a robot shown only from its files: the balance, from its masses. */
export const FILE_READINGS: OverlayReadings = {
  ...{ wrenches: [], deviations: [], imus: [], body: null, based: false, loads: null },
  balance: { schema: SCHEMA, choice: 'on', limits: null, joints: [], anchored: false },
};
