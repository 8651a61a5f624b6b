import { Debounce } from '../../kit.ts';
import { type QualityStep, QualitySteps } from './quality_steps.ts';

/** This many losses within `WITHIN_MS` are tolerated; after one more, this browser is assumed unable to hold a context. */
export const MOST_LOSSES = 3;
export const WITHIN_MS = 120_000;
/** How long to wait for the context: a browser that gives it back at all does so sooner. */
export const PATIENCE_MS = 8000;

/** Counts how often the browser took the WebGL context away, and decides when to stop waiting for it. */
export class ContextLossPolicy {
  #times: number[] = []; // at most MOST_LOSSES + 1

  /** Counts one loss. False if there were more than `MOST_LOSSES` within `WITHIN_MS`: 3D is then given up. */
  recordLoss(nowMs: number): boolean {
    this.#times = [...this.#times.filter((ms) => nowMs - ms < WITHIN_MS), nowMs].slice(-MOST_LOSSES - 1);
    return this.#times.length <= MOST_LOSSES;
  }
}

/** A problem with the drawing itself. `lost`: the browser took the WebGL context away and should give it back; `failed`: it did
 *  not; `pixels`, `detail`: fewer pixels or less detail, because this device is slow; `hopeless`: it is still too slow, and the
 *  light view could show the robot instead. */
export type DrawingTrouble = 'lost' | 'failed' | 'pixels' | 'detail' | 'hopeless';

/** The drawing whose quality is adapted. */
export interface Drawing {
  /** Uses this step's pixels, shadows and level of detail from now on. */
  applyStep(step: QualityStep): void;
  /** Whether a robot is drawn at a coarser level of detail than available. */
  isCoarse(): boolean;
  /** Whether the light view could draw the same scene. */
  isReplaceable(): boolean;
  /** Reports a problem with the drawing to the page; null if there is none. */
  report(trouble: DrawingTrouble | null): void;
}

/** Adapts a drawing to its device: reduces quality while repaints are slow, and reports a lost WebGL context, first as lost and,
 *  after `PATIENCE_MS` or too many losses, as failed. */
export class AdaptiveQuality {
  readonly #drawing: Drawing;
  readonly #contextLosses = new ContextLossPolicy();
  readonly #steps = new QualitySteps();
  #contextIsLost = false;
  readonly #giveUp = new Debounce(PATIENCE_MS, () => this.#drawing.report('failed'));

  constructor(drawing: Drawing) {
    this.#drawing = drawing;
  }

  /** The fraction (0…1) of the screen's pixels to draw along each side while something moves. */
  get pixels(): number {
    return this.#steps.step.pixels;
  }

  /** Takes the time between two repaints, ms, during all of which something moved. */
  recordRepaint(ms: number): void {
    if (this.#steps.recordRepaint(ms)) this.#applyStep();
  }

  /** Forgets all measurements and returns to full quality. */
  reset(): void {
    this.#steps.reset();
    this.#applyStep();
  }

  /** The scene has given its WebGL context back, which is no trouble. */
  contextGivenBack(): void {
    this.#contextIsLost = true;
    this.#giveUp.cancel();
  }

  /** The scene has asked for its context again. */
  contextRequested(): void {
    this.#giveUp.restart();
  }

  /** The browser took the WebGL context away. */
  contextLost(nowMs: number): void {
    this.#contextIsLost = true;
    const wait = this.#contextLosses.recordLoss(nowMs);
    this.#drawing.report(wait ? 'lost' : 'failed');
    if (wait) this.#giveUp.restart();
  }

  /** The browser gave a WebGL context back. */
  contextRestored(): void {
    this.#contextIsLost = false;
    this.#giveUp.cancel();
    this.#drawing.report(this.#trouble());
  }

  dispose(): void {
    this.#giveUp.cancel();
  }

  #applyStep(): void {
    this.#drawing.applyStep(this.#steps.step);
    if (!this.#contextIsLost) this.#drawing.report(this.#trouble()); // a lost context is reported first
  }

  #trouble(): DrawingTrouble | null {
    if (this.#steps.hopeless && this.#drawing.isReplaceable()) return 'hopeless';
    if (this.#drawing.isCoarse()) return 'detail';
    return this.#steps.step.pixels < 1 ? 'pixels' : null;
  }
}
