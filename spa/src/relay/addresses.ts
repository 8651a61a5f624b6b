import { relayChoice } from './relay.ts';

/** Where things are, below the relay that this page reads. */

/** As often as the eye can use; the relay gives less when it must. */
export const WANTED_HZ = 30;

export function apiUrl(path: string): string {
  return `${relayChoice().base}api/v1/${path}`;
}

/** Of a relay; of a mirror it is no WebSocket's. */
export function streamUrl(robot: string): string {
  const { mirror } = relayChoice();
  if (mirror !== null) return `${mirror}posecast/${robot}.json`;
  return apiUrl(`robots/${robot}/live`).replace(/^http/, 'ws');
}

export function manifestUrl(robot: string, modelHash: string): string {
  return apiUrl(`robots/${robot}/model/${modelHash}/manifest.json`);
}
