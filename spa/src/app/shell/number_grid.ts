import { type Display, stepsOf, stepsText } from '../../twin/format.ts';

/**
 * The numbers of a table, row by row. The shown values are kept in typed arrays, which are fast to compare, and the DOM is
 * written only where a number will look different.
 */
export class NumberGrid {
  readonly #nodes: readonly Text[];
  /** The shown value in steps of the last digit. */
  readonly #steps: Float64Array;
  /** 1 if the number is the last known one, not the present one. */
  readonly #old: Uint8Array;

  constructor(cells: readonly HTMLElement[]) {
    this.#nodes = cells.map((cell) => cell.appendChild(new Text()));
    this.#steps = new Float64Array(cells.length);
    this.#old = new Uint8Array(cells.length);
    this.forget();
  }

  /** Forgets what is shown, because the same numbers will look different (another unit). */
  forget(): void {
    this.#steps.fill(-0); // an impossible step count, so that everything is written again
  }

  /** Shows a value. `old`: it is the last known value, not the present one. */
  set(at: number, value: number | null, display: Display, old: boolean): void {
    const node = this.#nodes[at]!;
    if (this.#old[at] !== Number(old)) {
      this.#old[at] = Number(old);
      node.parentElement?.toggleAttribute('data-old', old);
    }
    const steps = stepsOf(value, display);
    if (Object.is(steps, this.#steps[at])) return;
    this.#steps[at] = steps;
    node.data = stepsText(steps, display);
  }
}
