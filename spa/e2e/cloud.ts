/** A cloud started by somebody else, in which the tests run instead of starting relays: `make compose-test`. */

import { execFile } from 'node:child_process';
import { promisify } from 'node:util';
import { until } from './driver/until.ts';

export interface Cloud {
  /** Its page. */
  readonly url: string;
  /** Its address for robots. */
  readonly robotsAt: string;
  /** A folder with a credential for each robot, by its name. */
  readonly credentials: string;
  /** No robot and no event from an earlier test: like a relay that has just started. */
  readonly forget: () => Promise<void>;
}

const { POSECAST_URL: url, POSECAST_ROBOTS_AT, POSECAST_CREDENTIALS, POSECAST_FORGET } = process.env;

export const CLOUD: Cloud | null =
  url === undefined
    ? null
    : {
        url,
        robotsAt: POSECAST_ROBOTS_AT ?? '',
        credentials: POSECAST_CREDENTIALS ?? '',
        forget: async () => {
          await promisify(execFile)('sh', ['-c', POSECAST_FORGET ?? '']);
          await until('it serves again', async () => (await fetch(`${url}/api/v1/robots`)).ok);
        },
      };
