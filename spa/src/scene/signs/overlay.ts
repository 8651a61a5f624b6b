import type { PosedBody } from '../../model/posed_body.ts';
import type { OverlayReadings } from '../../twin/overlay/reader.ts';
import type { Pose } from '../../twin/playback/pose.ts';
import { AttitudeReadout } from './attitude_readout.ts';
import type { BalancePicture } from './balance_drawing.ts';
import type { OverlayColors } from './colors.ts';
import type { FacetNumbers } from './facet_numbers.ts';
import type { LabelRoom } from './label_layout.ts';
import { type LabelPlace, OverlayLabels } from './labels.ts';
import { type OverlayStyle, RANK, RobotOverlay, type ShownOverlay } from './robot_overlay.ts';
import { Strokes } from './strokes.ts';

/** A robot in the picture whose overlay is drawn. */
export interface OverlayBearer {
  /** null while it has no body. */
  readonly figure: PosedBody | null;
  /** The displayed pose. */
  readonly pose?: Pose | null;
}

/**
 * The overlay of all robots of one picture, independent of the renderer: strokes and facets for the canvas and labels over it. It
 * is rebuilt only in `make`, so that six moving robots cost one rebuild per picture.
 */
export class Overlay {
  readonly strokes = new Strokes();
  #balance: BalancePicture | null = null;
  readonly #labels: OverlayLabels;
  readonly #readout: AttitudeReadout;
  readonly #signs = new Map<OverlayBearer, RobotOverlay>();
  #tones: OverlayColors;
  #old = true;

  constructor(host: HTMLElement, tones: OverlayColors) {
    this.#readout = new AttitudeReadout(host.parentElement ?? host);
    this.#labels = new OverlayLabels(host, this.#readout.root);
    this.#tones = tones;
  }

  /** null until something is drawn with facets. */
  get facets(): FacetNumbers | null {
    return this.#balance?.facets ?? null;
  }

  shown(of: OverlayBearer): ShownOverlay {
    return this.#of(of).shown;
  }

  /** Takes a robot's newest readings and their style. */
  show(of: OverlayBearer, readings: OverlayReadings | null, manner?: OverlayStyle): void {
    if (readings?.balance && manner?.balance) this.#balance ??= manner.balance();
    this.#of(of).take(readings, manner, this.#balance);
    this.#old = true;
  }

  /** Call this when a robot has moved or its body has changed. */
  moved(): void {
    this.#old = true;
  }

  /** Measures the robots' sizes again, for example after more of their meshes have loaded. */
  measure(): void {
    for (const signs of this.#signs.values()) signs.measure();
    this.#old = true;
  }

  setTones(tones: OverlayColors): void {
    this.#tones = tones;
    this.#old = true;
  }

  /** Advances the easing of arrows. True while it continues. */
  advance(seconds: number): boolean {
    let moving = false;
    for (const signs of this.#signs.values()) moving = signs.advance(seconds) || moving;
    this.#old ||= moving;
    return moving;
  }

  /** Rebuilds strokes and labels if needed. True if that changes the picture. */
  make(): boolean {
    if (!this.#old) return false;
    this.#old = false;
    const all = [...this.#signs.values()];
    this.strokes.begin();
    this.#balance?.begin();
    let repainted = false;
    for (const [bearer, signs] of this.#signs) {
      const { figure, pose = null } = bearer;
      repainted = signs.draw(this.strokes, figure, pose, this.#tones) || repainted;
    }
    const filled = this.#balance?.end() ?? false;
    const changed = this.strokes.end() || filled;
    const labels = all.flatMap((signs, i) =>
      all.length === 1
        ? signs.labels()
        : signs.labels().map((label) => ({ ...label, key: `${i}-${label.key}` })),
    );
    this.#labels.set(labels.sort((a, b) => RANK[a.level] - RANK[b.level]));
    const alone = all.length === 1 ? all[0]! : null; // several robots have no common lean
    this.#readout.show(alone?.lean ?? null);
    return changed || repainted;
  }

  /** Places the labels in a picture. */
  placeLabels(place: LabelPlace, room: LabelRoom): void {
    this.#labels.place(place, room);
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
