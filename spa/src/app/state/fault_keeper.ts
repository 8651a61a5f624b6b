import { useSyncExternalStore } from 'react';
import { readStored, writeStored } from '../../browser/storage.ts';
import { Emitter } from '../../kit.ts';
import { acknowledgedText, type Fault, FaultLog, readAcknowledged } from '../../twin/alarms/fault_log.ts';
import type { RobotTwin } from '../../twin/robot.ts';

/** Collects one robot's faults while its page is open. Acknowledgements are kept in the browser's storage. */
export class FaultKeeper {
  #log: FaultLog;
  readonly #twin: RobotTwin;
  /** The time of the displayed state. */
  readonly nowMs: () => number;
  readonly #key: string | null;
  readonly #changed = new Emitter();
  readonly #leave: readonly (() => void)[];
  #list: readonly Fault[] | null = null;
  /** Whether a frame or a fault has come. */
  #isSeen = false;
  /** Whether the recorded past may still tell of faults. */
  #isRecalling = false;

  /** @param nowMs is the time of the states that the robot shows. @param kept says whether acknowledgements are. */
  constructor(twin: RobotTwin, nowMs: () => number, kept = true) {
    this.#twin = twin;
    this.nowMs = nowMs;
    this.#key = kept ? `posecast.acknowledged.${twin.robot}` : null;
    this.#log = new FaultLog(this.#key === null ? undefined : readAcknowledged(readStored(this.#key)));
    this.#leave = [twin.onState(() => this.#frame()), twin.onChange(() => this.#events())];
  }

  get log(): FaultLog {
    return this.#log;
  }

  /** Forgets all faults: the following data is from another time. */
  begin(): void {
    this.#log = new FaultLog();
    this.#list = null;
    this.#isSeen = false;
    this.#changed.emit();
  }

  /** Waits for `recall`: until then, it is not known that there are no faults. */
  expectPast(): void {
    this.#isRecalling = true;
  }

  /** Adds recorded events, oldest first: a relay that has restarted no longer sends those from before. */
  recall(events: RobotTwin['events']): void {
    for (const event of events) this.log.event(event, this.nowMs());
    this.#isRecalling = false;
    this.#tell();
  }

  /** Forgets the faults of deleted spans. */
  forget(spans: RobotTwin['deleted']): void {
    this.log.forget(spans);
    this.#events(); // the same fault may also have begun at another time
  }

  /** All faults; null until it is known whether there are any: until a frame or a fault event has arrived, and all earlier
   *  events. */
  readonly faults = (): readonly Fault[] | null => this.#list;

  /** Adds a listener for changes of `faults`. Returns a function that removes it. */
  readonly onChange = this.#changed.on;

  /** Marks faults as acknowledged by the viewer, and stores that. */
  acknowledge(faults: readonly Fault[]): void {
    this.log.acknowledge(faults.map((fault) => fault.key));
    this.#keep();
    this.#tell();
  }

  /** Stops listening to the robot. */
  close(): void {
    for (const leave of this.#leave) leave();
  }

  /** Checks every frame, because a fault may last for only one of them. */
  #frame(): void {
    const joints = this.#twin.joints();
    if (joints === null) return;
    const acknowledged = this.log.acknowledged.size;
    this.log.rows(joints.rows, this.nowMs());
    if (this.log.acknowledged.size !== acknowledged) this.#keep();
    this.#isSeen = true;
    this.#tell();
  }

  #keep(): void {
    if (this.#key !== null) writeStored(this.#key, acknowledgedText(this.log.acknowledged));
  }

  #events(): void {
    for (const event of this.#twin.events) this.log.event(event, this.nowMs());
    this.#tell();
  }

  #tell(): void {
    const { faults } = this.log;
    const isKnown = this.#isSeen && this.#twin.hasAllEvents && !this.#isRecalling;
    const list = faults.length > 0 || isKnown ? faults : null;
    if (this.#list === list) return;
    this.#list = list;
    this.#changed.emit();
  }
}

/** A robot's faults; null while it is not known whether there are any. The component is drawn again when they change. */
export function useFaults(keeper: FaultKeeper): readonly Fault[] | null {
  return useSyncExternalStore(keeper.onChange, keeper.faults);
}
