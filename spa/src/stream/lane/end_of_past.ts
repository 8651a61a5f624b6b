import type { PartName } from './answers.ts';

/** After this many consecutive parts that already existed, the end of the past is requested again. */
const LOOK_EVERY = 3;
/** If parts were missed, at most this many are fetched for their events; beyond that the lane skips to the newest. */
const MISSED_MAX = 3;

/** Tracks whether the lane has reached the end of the recorded data: it has if a request was held, or was answered with "not
 *  yet". The starting point may be long past, because a cache may serve an old answer. In that case the lane reads on at once,
 *  and asks for the end again now and then. */
export class EndOfPast {
  /** Consecutive parts that already existed. */
  #ready = 0;
  /** The last known newest part. */
  #told: PartName | null = null;

  recordPart(wasHeld: boolean): void {
    this.#ready = wasHeld ? 0 : this.#ready + 1;
  }

  recordNotYet(): void {
    this.#ready = 0;
  }

  /** A single such part may just have been requested too late; two mean that the lane is behind. */
  get isNear(): boolean {
    return this.#ready < 2;
  }

  get isToBeAsked(): boolean {
    return this.#ready > 0 && this.#ready % LOOK_EVERY === 0;
  }

  /** The next part of the lane: the one after the last, unless the newest is so far ahead that the picture is now too old. An
   *  answer received earlier came from a cache. */
  goOn(last: PartName | null, newest: PartName): PartName {
    const told = this.#told;
    this.#told = newest;
    if (last === null) return newest;
    const next = { take: last.take, index: last.index + 1 };
    if (told?.take === newest.take && told.index === newest.index) return next;
    const by = last.take === newest.take ? newest.index - last.index : Number.POSITIVE_INFINITY;
    return by >= -1 && by <= MISSED_MAX ? next : newest;
  }
}
