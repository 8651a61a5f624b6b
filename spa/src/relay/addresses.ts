import { accounts, relayChoice, relaySettled } from './relay.ts';
import { tokenFor, withholdTokens } from './token.ts';
import { wasSignedIn } from './visitor.ts';

/** Addresses (URLs) on the relay that this page reads. */

/** The frame rate to ask for, Hz; the relay may grant less. */
export const WANTED_HZ = 30;

export function apiUrl(path: string): string {
  return `${relayChoice().base}api/v1/${path}`;
}

/** The stream's address: a WebSocket URL at a relay, an HTTP URL at a mirror. */
export function streamUrl(robot: string): string {
  const { mirror } = relayChoice();
  if (mirror !== null) return `${mirror}posecast/${robot}.json`;
  return apiUrl(`robots/${robot}/live`).replace(/^http/, 'ws');
}

/** The lane chosen by `config.json` or the address: viewers without a token read a robot as segments, through caches. */

/** Whether a stream has fallen back from the lane to the relay, because the lane did not answer. */
let isLeft = false;

/** Called when a robot's stream has opened. If it should have used the lane, the lane did not answer: until the page is closed,
 *  models, the past and other robots are then requested from the relay as well. */
export function leaveLane(robot: string): void {
  isLeft ||= isInLane(robot);
}

/** The address at which this page reads a robot's segments instead of opening a socket. Null if it opens a socket: without a
 *  lane, or with a token, because caches hold only what anyone may see. */
export function laneUrl(robot: string): string | null {
  return isInLane(robot) ? pastUrl(robot) : null;
}

/** The address of a robot's past. */
export function pastUrl(robot: string): string {
  return keptUrl(robot, 'past');
}

export function manifestUrl(robot: string, modelHash: string): string {
  return keptUrl(robot, `model/${modelHash}/manifest.json`);
}

function isInLane(robot: string): boolean {
  return !isLeft && relayChoice().lane !== null && !tokenFor(`/api/v1/robots/${robot}/`);
}

/** The address of a resource below the robot's own path that a cache may hold for everybody. */
function keptUrl(robot: string, path: string): string {
  const below = `robots/${robot}/${path}`;
  return isInLane(robot) ? `${relayChoice().lane}api/v1/${below}` : apiUrl(below);
}

let asking: ReturnType<typeof relaySettled> | null = null;

/** Resolves when it is known which relay this page reads and, if somebody has signed in here before, whether they still are.
 *  Later calls get the same result. */
export function accessSettled(): ReturnType<typeof relaySettled> {
  asking ??= relaySettled().then(async (choice) => {
    if (choice.lane !== null && choice.lane !== choice.base) withholdTokens(`${choice.lane}api/v1/`);
    if (accounts !== null && wasSignedIn()) {
      await import('./account.ts').then(({ restoreSession }) => restoreSession()).catch(() => {}); // continue without an account
    }
    return choice;
  });
  return asking;
}
