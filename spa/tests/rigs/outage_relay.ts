import { frameId, parseHeader } from '@posecast/wire';
import { STALE_AFTER_MS } from '../../src/twin/liveness.ts';

export interface Held {
  bytes: Uint8Array;
  id: number;
  seq: number;
  key: Held | null;
}

/** The relay's own clock, ms. */
export function clockMs(nowMs: number): number {
  return 7e11 + nowMs;
}

/** A relay for one robot: keeps the newest frame and its KEY. Times are ms of the simulation's clock. */
export class Relay {
  key: Held | null = null;
  newest: Held | null = null;
  liveMs: number | null = null;
  /** The edge has just sent the newest one. */
  isLive = false;
  token = true;
  #run = 0;

  /** `liveMs`: null for frames from a snapshot. */
  take(bytes: Uint8Array, run: number, liveMs: number | null): void {
    const header = parseHeader(bytes);
    const id = frameId(bytes);
    if (header.isKey) {
      if (run === this.#run && header.seq <= (this.newest?.seq ?? -1)) return;
      this.#run = run;
      this.key = { bytes, id, seq: header.seq, key: null };
      this.newest = this.key;
    } else {
      const { key } = this;
      if (key?.id !== header.baseId || run !== this.#run) return;
      const seq = key.seq + header.distance;
      if (seq <= (this.newest?.seq ?? -1)) return;
      this.newest = { bytes, id, seq, key };
    }
    this.isLive = liveMs !== null;
    if (liveMs !== null) this.liveMs = liveMs;
  }

  status(nowMs: number): string {
    const ageMs = this.liveMs === null ? null : nowMs - this.liveMs;
    const silent = ageMs === null || ageMs > STALE_AFTER_MS;
    const robot = this.token ? (silent ? 'silent' : 'online') : 'offline';
    const seq = this.newest?.seq ?? null;
    return JSON.stringify({ type: 'status', robot, age_ms: ageMs, seq, clock_ms: clockMs(nowMs) });
  }
}
