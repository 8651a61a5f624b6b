import { relayChoice } from './relay.ts';

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
