import type { EventMessage } from '@posecast/wire';

/** As a part lists at most: of more the oldest are missing in it (wire/SPEC.md §10). */
export const FAULTS_MAX = 100;

/** The faults that the page takes for open, as the events that it was told say. */
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
