import { useSyncExternalStore } from 'react';
import { acknowledgedText, type Fault, FaultBook, readAcknowledged } from '../../twin/alarms/fault_log.ts';
import type { RobotTwin } from '../../twin/robot.ts';

/** Keeps one robot's faults while its page is open; what was acknowledged stays in this browser. */
export class FaultKeeper {
  readonly book: FaultBook;
  readonly #twin: RobotTwin;
  readonly #key: string;
  readonly #listeners = new Set<() => void>();
  readonly #leave: readonly (() => void)[];
  #list: readonly Fault[] | null = null;

  constructor(twin: RobotTwin) {
    this.#twin = twin;
    this.#key = `posecast.acknowledged.${twin.robot}`;
    this.book = new FaultBook(readAcknowledged(stored(this.#key)));
    this.#leave = [twin.onState(() => this.#frame()), twin.onChange(() => this.#events())];
  }

  /** null until a pose or an event has come: no news of faults is not "no faults". */
  readonly faults = (): readonly Fault[] | null => this.#list;

  readonly onChange = (listener: () => void): (() => void) => {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  };

  acknowledge(faults: readonly Fault[]): void {
    this.book.acknowledge(faults.map((fault) => fault.key));
    this.#keep();
    this.#tell();
  }

  close(): void {
    for (const leave of this.#leave) leave();
  }

  /** Every frame is looked at, also those that no eye could follow. */
  #frame(): void {
    const joints = this.#twin.joints();
    if (joints === null) return;
    const acknowledged = this.book.acknowledged.size;
    this.book.rows(joints.rows, Date.now());
    if (this.book.acknowledged.size !== acknowledged) this.#keep();
    this.#list ??= [];
    this.#tell();
  }

  #keep(): void {
    try {
      window.localStorage.setItem(this.#key, acknowledgedText(this.book.acknowledged));
    } catch {
      // it holds as long as the page does
    }
  }

  #events(): void {
    for (const event of this.#twin.events) this.book.event(event, Date.now());
    if (this.book.faults.length > 0) this.#list ??= [];
    this.#tell();
  }

  #tell(): void {
    if (this.#list === null || this.#list === this.book.faults) return;
    this.#list = this.book.faults;
    for (const listener of this.#listeners) listener();
  }
}

export function useFaults(keeper: FaultKeeper): readonly Fault[] | null {
  return useSyncExternalStore(keeper.onChange, keeper.faults);
}

function stored(key: string): string | null {
  try {
    return window.localStorage.getItem(key);
  } catch {
    return null;
  }
}
