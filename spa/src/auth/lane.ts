import { apiUrl } from '../relay/addresses.ts';
import { relayChoice } from '../relay/relay.ts';
import { tokenFor } from './token.ts';

/** The lane that `config.json` or the address chooses: who has no token reads a robot in segments, by way of caches. */

/** Whether a stream has gone from the lane to the relay, because nobody answered there. */
let isLeft = false;

/** A robot's stream has opened elsewhere. If it should be in the lane, nobody answered there: as long as the page is open, models,
 *  the past and other robots are asked for at the relay as well. */
export function leaveLane(robot: string): void {
  isLeft ||= isInLane(robot);
}

/** Where this page reads a robot's segments instead of a socket; null where it takes a socket: where no lane is chosen, and with
 *  a token, since caches hold only what anyone may see. */
export function laneUrl(robot: string): string | null {
  return isInLane(robot) ? pastUrl(robot) : null;
}

/** Where the past of a robot is asked for. */
export function pastUrl(robot: string): string {
  return keptUrl(robot, 'past');
}

export function manifestUrl(robot: string, modelHash: string): string {
  return keptUrl(robot, `model/${modelHash}/manifest.json`);
}

function isInLane(robot: string): boolean {
  return !isLeft && relayChoice().lane !== null && !tokenFor(`/api/v1/robots/${robot}/`);
}

/** The address of something that a cache may hold for everybody, below a robot's own. */
function keptUrl(robot: string, path: string): string {
  const below = `robots/${robot}/${path}`;
  return isInLane(robot) ? `${relayChoice().lane}api/v1/${below}` : apiUrl(below);
}
