import type { CdrWriter } from './cdr_writer.ts';

/** The range ends in 2038. */
const SECONDS_MAX = 2 ** 31 - 1;

/** std_msgs/Header. `atUs`: unix; `link`: what the values are relative to, as UTF-8. */
export function writeHeader(to: CdrWriter, atUs: number, link: Uint8Array): void {
  writeStamp(to, atUs);
  to.utf8(link);
}

/** builtin_interfaces/Time; values out of range become its last moment. */
export function writeStamp(to: CdrWriter, atUs: number): void {
  const seconds = Math.floor(atUs / 1e6);
  const isWithin = seconds <= SECONDS_MAX;
  to.i32(isWithin ? seconds : SECONDS_MAX);
  to.u32(isWithin ? (atUs - seconds * 1e6) * 1000 : 999_999_999);
}
