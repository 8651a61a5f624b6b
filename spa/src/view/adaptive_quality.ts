import { Debounce } from '../browser/debounce.ts';
import { ContextLossPolicy, PATIENCE_MS } from './context_loss.ts';
import { type QualityStep, QualitySteps } from './quality_steps.ts';

/** What the page should say of the drawing itself. `lost`: the browser took the context away and should give it back;
 *  `failed`: it won't; `pixels`, `detail`: less of them, because this device is slow; `hopeless`: it is still too slow, and
 *  the light view could show the robot. */
export type DrawingTrouble = 'lost' | 'failed' | 'pixels' | 'detail' | 'hopeless';

/** Who draws, and who is told. */
export interface Drawing {
  /** Draw with so much from now on. */
  applyStep(step: QualityStep): void;
  /** Whether a robot shows less than it could. */
  isCoarse(): boolean;
  /** Whether the light view could take this one's place. */
  isReplaceable(): boolean;
  /** null is all well. */
  report(trouble: DrawingTrouble | null): void;
}

/** What a device can bear: what is given up when it is slow, and how long a lost context is waited for. */
export class AdaptiveQuality {
  readonly #drawing: Drawing;
  readonly #contextLosses = new ContextLossPolicy();
  readonly #steps = new QualitySteps();
  #away = false; // the context
  readonly #giveUp = new Debounce(PATIENCE_MS, () => this.#drawing.report('failed'));

  constructor(drawing: Drawing) {
    this.#drawing = drawing;
  }

  /** Of the screen's pixels, along each side, while something moves. */
  get pixels(): number {
    return this.#steps.step.pixels;
  }

  /** How long a repaint took in which something moved all the time. */
  recordRepaint(ms: number): void {
    if (this.#steps.recordRepaint(ms)) this.#keep();
  }

  /** As on a device of which nothing is known. */
  reset(): void {
    this.#steps.reset();
    this.#keep();
  }

  /** The browser took the context away. */
  contextLost(nowMs: number): void {
    this.#away = true;
    const wait = this.#contextLosses.recordLoss(nowMs);
    this.#drawing.report(wait ? 'lost' : 'failed');
    if (wait) this.#giveUp.restart();
  }

  /** It gave one back. */
  contextRestored(): void {
    this.#away = false;
    this.#giveUp.cancel();
    this.#drawing.report(this.#trouble());
  }

  dispose(): void {
    this.#giveUp.cancel();
  }

  #keep(): void {
    this.#drawing.applyStep(this.#steps.step);
    if (!this.#away) this.#drawing.report(this.#trouble()); // what was slow before says nothing of a context that is gone
  }

  #trouble(): DrawingTrouble | null {
    if (this.#steps.hopeless && this.#drawing.isReplaceable()) return 'hopeless';
    if (this.#drawing.isCoarse()) return 'detail';
    return this.#steps.step.pixels < 1 ? 'pixels' : null;
  }
}
