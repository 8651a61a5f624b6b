/** The demo robot at moments of its motion, held for as long as a picture takes. */

import { setTimeout as pause } from 'node:timers/promises';
import type { Process } from '../process.ts';
import { DEMO, demoOver, type Moment } from '../sign_words.ts';
import type { Relay, Stack } from '../stack.ts';

/** For a neck joint, rad: an invisible change of the pose. */
const STIR_RAD = 0.004;
const PLAYED_HZ = 30;
/** Readings that change thirty times a second without visible effect, so that the picture is at rest. A command, for a joint at
 *  0, makes the robot count as live and not as holding; a current makes each frame new. */
const UNSEEN = { ref: { RWR: [0.003, 0.4] }, cur: { LKN: [1.2, 0.4] } };

export class PosedDemo {
  readonly #source: Process;
  readonly edge: Process;
  #moment: Moment;
  #stirs = 0;

  constructor(stack: Stack, relay: Relay, moment: Moment, robot = 'demo') {
    this.#moment = moment;
    const { source, edge } = stack.fedEdge(relay, { ...moment, wave: UNSEEN }, { ...DEMO, robot });
    this.#source = source;
    this.edge = edge;
  }

  show(moment: Moment): void {
    this.#moment = moment;
    this.stir();
  }

  /** Changes the pose invisibly, so that the robot is live and not holding. */
  stir(): void {
    this.#stirs += 1;
    const pos = this.#moment.pos ?? {};
    const NK1 = (pos.NK1 ?? 0) + (this.#stirs % 2) * STIR_RAD;
    this.#source.write(JSON.stringify({ ...this.#moment, pos: { ...pos, NK1 }, wave: UNSEEN }));
  }

  /** Stands still with all its readings, so that it becomes HOLDING. */
  hold(): void {
    this.#source.write(JSON.stringify(this.#moment));
  }

  /** Plays its motion between two of its seconds, in real time. */
  async play(fromS: number, toS: number): Promise<void> {
    const count = Math.round((toS - fromS) * PLAYED_HZ);
    const moments = demoOver(Array.from({ length: count }, (_, i) => fromS + i / PLAYED_HZ));
    const beganMs = performance.now();
    for (const [i, moment] of moments.entries()) {
      await pause(Math.max(0, beganMs + (1000 * i) / PLAYED_HZ - performance.now()));
      this.show(moment);
    }
  }

  /** Stops the robot's program but not the agent. */
  silence(): void {
    this.#source.signal('SIGSTOP');
  }

  speak(): void {
    this.#source.signal('SIGCONT');
  }
}
