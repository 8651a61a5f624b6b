import { fieldsOf } from '../../kit.ts';

/** Reads a relay's answers about its newest parts (`docs/reference/protocol.md`, *The past*). Anything that deviates from it is
 *  null. */

/** The name of a part: its take, 16 hexadecimal digits, and its index in it. */
export interface PartName {
  readonly take: string;
  readonly index: number;
}

/** A complete answer. `retryMs`: when the relay wants to be asked again, if it says so. */
export interface LaneAnswer {
  readonly status: number;
  readonly isJson: boolean;
  readonly retryMs: number | null;
  /** When it was made or forwarded, unix ms, to the second, by the clock of the relay or of a cache; null if unknown. */
  readonly dateMs: number | null;
  readonly bytes: Uint8Array;
}

/** Where a lane begins. `newest`: null if nothing is recorded yet. `delayMs`: the delay for this audience. */
export interface LaneBeginning {
  readonly view: string;
  readonly newest: PartName | null;
  readonly delayMs: number;
  readonly isKept: boolean;
}

const INDEX_MAX = 2 ** 32 - 1;
const DELAY_MS_MAX = 1e9;

export function readBeginning(answer: LaneAnswer): LaneBeginning | null {
  const doc = membersOf(answer);
  const { view, past_ms, delay_ms } = doc;
  if (typeof view !== 'string' || !/^[a-z0-9][a-z0-9-]{0,62}$/.test(view)) return null;
  if (typeof past_ms !== 'number') return null;
  const delayMs = typeof delay_ms === 'number' && delay_ms > 0 && delay_ms < DELAY_MS_MAX ? delay_ms : 0;
  return { view, newest: nameOf(doc.newest), delayMs, isKept: past_ms > 0 };
}

/** The part that replaces the requested one. */
export function readNext(answer: LaneAnswer): PartName | null {
  return nameOf(membersOf(answer).next);
}

export function membersOf({ bytes, isJson }: LaneAnswer): Readonly<Record<string, unknown>> {
  try {
    return isJson ? fieldsOf(JSON.parse(new TextDecoder().decode(bytes))) : {};
  } catch {
    return {};
  }
}

function nameOf(value: unknown): PartName | null {
  const { take, index } = fieldsOf(value);
  if (typeof take !== 'string' || !/^[0-9a-f]{16}$/.test(take)) return null;
  return typeof index === 'number' && Number.isInteger(index) && index >= 0 && index <= INDEX_MAX
    ? { take, index }
    : null;
}
