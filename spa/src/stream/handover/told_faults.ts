import type { EventMessage } from '@posecast/wire';

/** As a part lists at most: of more the oldest are missing in it (wire/SPEC.md §10). */
const FAULTS_MAX = 100;
const N_STEP = 2 ** -20;

/** The faults that the page takes for open, as the events that it was told say. */
export class ToldFaults {
  readonly #open = new Map<string, EventMessage>();

  constructor(told: Iterable<EventMessage> = []) {
    for (const event of told) this.record(event);
  }

  get open(): EventMessage[] {
    return [...this.#open.values()];
  }

  record(event: EventMessage): void {
    const cause = causeOf(event);
    this.#open.delete(cause);
    if (event.state !== 'on') return;
    this.#open.set(cause, event);
    if (this.#open.size > FAULTS_MAX) this.#open.delete(this.#open.keys().next().value!);
  }

  /** Ends for the faults that began before a moment (unix ms) and are not open then, of which nobody told the end. `open`: all that
   *  are; `n`: the newest event's number. Theirs lie between that and the next. */
  listEnds(open: readonly EventMessage[], atMs: number, n: number): EventMessage[] {
    if (open.length >= FAULTS_MAX) return [];
    const causes = new Set(open.map(causeOf));
    return this.open
      .filter((event) => event.at !== null && 1000 * event.at < atMs && !causes.has(causeOf(event)))
      .map((event, i) => ({ ...event, n: n + (i + 1) * N_STEP, at: atMs / 1000, state: 'off' }));
  }
}

function causeOf({ source, text }: EventMessage): string {
  return `${source}\n${text}`;
}
