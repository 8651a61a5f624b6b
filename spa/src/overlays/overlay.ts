import type { PosedBody } from '../model/posed_body.ts';
import type { OverlayReadings } from '../twin/overlay/reader.ts';
import { AttitudeReadout } from './attitude_readout.ts';
import type { OverlayColors } from './colors.ts';
import { type LabelPlace, OverlayLabels } from './labels.ts';
import { type OverlayStyle, RANK, RobotOverlay, type ShownOverlay } from './robot_overlay.ts';
import { Strokes } from './strokes.ts';

/** Whose signs they are: one of the robots in the picture. */
export interface OverlayBearer {
  /** null while it has no body. */
  readonly figure: PosedBody | null;
}

/**
 * All that is drawn about the robots of one picture, however that is drawn: strokes for whoever has a canvas, and words
 * over it. Nothing is made anew before somebody asks for it (`make`), so that six robots that move cost one picture.
 */
export class Overlay {
  readonly strokes = new Strokes();
  readonly #labels: OverlayLabels;
  readonly #readout: AttitudeReadout;
  readonly #signs = new Map<OverlayBearer, RobotOverlay>();
  #tones: OverlayColors;
  #old = true;

  constructor(host: HTMLElement, tones: OverlayColors) {
    this.#labels = new OverlayLabels(host);
    this.#readout = new AttitudeReadout(host);
    this.#tones = tones;
  }

  shown(of: OverlayBearer): ShownOverlay {
    return this.#of(of).shown;
  }

  /** The newest readings of a robot and how they are wanted. */
  show(of: OverlayBearer, readings: OverlayReadings | null, manner?: OverlayStyle): void {
    this.#of(of).take(readings, manner);
    this.#old = true;
  }

  /** A robot has moved, or has another body. */
  moved(): void {
    this.#old = true;
  }

  /** Robots may have another size: they wear more than before. */
  measure(): void {
    for (const signs of this.#signs.values()) signs.measure();
    this.#old = true;
  }

  setTones(tones: OverlayColors): void {
    this.#tones = tones;
    this.#old = true;
  }

  /** Lets arrows glide. True while they do. */
  advance(seconds: number): boolean {
    let moving = false;
    for (const signs of this.#signs.values()) moving = signs.advance(seconds) || moving;
    this.#old ||= moving;
    return moving;
  }

  /** Makes strokes and words of what is known now. True when there is another picture than before. */
  make(): boolean {
    if (!this.#old) return false;
    this.#old = false;
    this.strokes.begin();
    let repainted = false;
    for (const [{ figure }, signs] of this.#signs) {
      repainted = signs.draw(this.strokes, figure, this.#tones) || repainted;
    }
    const changed = this.strokes.end();
    const all = [...this.#signs.values()];
    const labels = all.flatMap((signs, i) =>
      all.length === 1
        ? signs.labels()
        : signs.labels().map((label) => ({ ...label, key: `${i}-${label.key}` })),
    );
    this.#labels.set(labels.sort((a, b) => RANK[a.level] - RANK[b.level]));
    const alone = all.length === 1 ? all[0]! : null; // several have no one lean
    this.#readout.show(alone?.lean ?? null);
    return changed || repainted;
  }

  /** Puts the words where their points are in a picture of this width, CSS px. */
  placeLabels(place: LabelPlace, width: number): void {
    this.#labels.place(place, width);
  }

  dispose(): void {
    this.#labels.dispose();
    this.#readout.dispose();
  }

  #of(bearer: OverlayBearer): RobotOverlay {
    let signs = this.#signs.get(bearer);
    if (signs === undefined) {
      signs = new RobotOverlay();
      this.#signs.set(bearer, signs);
    }
    return signs;
  }
}
