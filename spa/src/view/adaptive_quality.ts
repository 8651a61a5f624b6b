import { Later } from '../browser/debounce.ts';
import { Losses, PATIENCE_MS } from './context_loss.ts';
import { Pace, type Step } from './quality_steps.ts';

/** What the page should say of the drawing itself. `lost`: the browser took the context away and should give it back;
 *  `failed`: it won't; `pixels`, `detail`: less of them, because this device is slow; `hopeless`: it is still too slow, and
 *  the light view could show the robot. */
export type Trouble = 'lost' | 'failed' | 'pixels' | 'detail' | 'hopeless';

/** Who draws, and who is told. */
export interface Drawing {
  /** Draw with so much from now on. */
  keep(step: Step): void;
  /** Whether a robot shows less than it could. */
  coarse(): boolean;
  /** Whether the light view could take this one's place. */
  replaceable(): boolean;
  /** null is all well. */
  say(trouble: Trouble | null): void;
}

/** What a device can bear: what is given up when it is slow, and how long a lost context is waited for. */
export class Stamina {
  readonly #drawing: Drawing;
  readonly #losses = new Losses();
  readonly #pace = new Pace();
  #away = false; // the context
  readonly #giveUp = new Later(PATIENCE_MS, () => this.#drawing.say('failed'));

  constructor(drawing: Drawing) {
    this.#drawing = drawing;
  }

  /** Of the screen's pixels, along each side, while something moves. */
  get pixels(): number {
    return this.#pace.step.pixels;
  }

  /** How long a repaint took in which something moved all the time. */
  took(ms: number): void {
    if (this.#pace.took(ms)) this.#keep();
  }

  /** As on a device of which nothing is known. */
  forget(): void {
    this.#pace.forget();
    this.#keep();
  }

  /** The browser took the context away. */
  lost(nowMs: number): void {
    this.#away = true;
    const wait = this.#losses.bearable(nowMs);
    this.#drawing.say(wait ? 'lost' : 'failed');
    if (wait) this.#giveUp.putOff();
  }

  /** It gave one back. */
  restored(): void {
    this.#away = false;
    this.#giveUp.callOff();
    this.#drawing.say(this.#trouble());
  }

  dispose(): void {
    this.#giveUp.callOff();
  }

  #keep(): void {
    this.#drawing.keep(this.#pace.step);
    if (!this.#away) this.#drawing.say(this.#trouble()); // what was slow before says nothing of a context that is gone
  }

  #trouble(): Trouble | null {
    if (this.#pace.hopeless && this.#drawing.replaceable()) return 'hopeless';
    if (this.#drawing.coarse()) return 'detail';
    return this.#pace.step.pixels < 1 ? 'pixels' : null;
  }
}
