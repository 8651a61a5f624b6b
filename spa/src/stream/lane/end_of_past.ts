import type { PartName } from './answers.ts';

/** After so many parts in a row that were there already it is asked anew where the past ends. */
const LOOK_EVERY = 3;
/** Of parts that were missed at most so many are fetched, for their events; else the lane goes on with the newest. */
const MISSED_MAX = 3;

/** Knows whether the lane has come to the end of what is recorded: it has where a request was held, or was told "not yet". Where
 *  it begins may be long past, since a cache may tell an old answer; then it reads on at once, and asks now and then anew. */
export class EndOfPast {
  /** Parts in a row that were there already. */
  #ready = 0;
  /** What was told to be the newest part at last. */
  #told: PartName | null = null;

  recordPart(wasHeld: boolean): void {
    this.#ready = wasHeld ? 0 : this.#ready + 1;
  }

  recordNotYet(): void {
    this.#ready = 0;
  }

  /** One part may have been asked for too late; of two, the lane is behind. */
  get isNear(): boolean {
    return this.#ready < 2;
  }

  get isToBeAsked(): boolean {
    return this.#ready > 0 && this.#ready % LOOK_EVERY === 0;
  }

  /** With which part the lane goes on: the one after the last, unless the newest is so much further that the robot was shown as
   *  it is now too late. What was told before is what a cache has kept. */
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
