import type { EventMessage } from '@posecast/wire';

/** The maximum that a part lists; if there are more, the oldest are missing (wire/SPEC.md §10). */
export const FAULTS_MAX = 100;

/** The faults that the page considers open, from the events that it has received. */
export class ToldFaults {
  readonly #open = new Map<string, EventMessage>();

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
}

export function causeOf({ source, text }: EventMessage): string {
  return `${source}\n${text}`;
}
