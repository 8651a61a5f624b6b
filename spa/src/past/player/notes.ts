import type { PastNote } from '../past_types.ts';
import { PATIENCE_MS, type Pending } from './tape/reel.ts';

/** How long a note is shown if nothing else ends it, ms. */
const NOTE_MS = 5000;
/** How long a note about a link is shown, ms: long enough to read it twice while the page opens. */
export const LINK_NOTE_MS = 15_000;

/** Which note the viewer sees; times are by the page's clock. */
export class PastNotes {
  #said: { note: PastNote; sinceMs: number } | null = null;
  /** Since when data is awaited. */
  #waitingMs: number | null = null;
  #isAway = false;

  say(note: PastNote, nowMs: number): void {
    this.#said = { note, sinceMs: nowMs };
  }

  /** The message no longer applies. */
  forget(): void {
    this.#said = null;
  }

  /** These are being awaited. */
  wait(pending: readonly Pending[], nowMs: number): void {
    this.#waitingMs ??= nowMs;
    this.#isAway = pending.some(({ state }) => state === 'away');
  }

  /** Nothing is awaited any more. */
  rest(): void {
    this.#waitingMs = null;
    this.#isAway = false;
  }

  read(nowMs: number): PastNote | null {
    if (this.#isAway) return 'away';
    if (this.#waitingMs !== null && nowMs - this.#waitingMs > PATIENCE_MS) return 'loading';
    const said = this.#said;
    if (said !== null && said.note !== 'not-kept') {
      const staysMs = said.note === 'not-come' ? LINK_NOTE_MS : NOTE_MS;
      if (nowMs - said.sinceMs >= staysMs) this.#said = null;
    }
    return this.#said?.note ?? null;
  }
}
