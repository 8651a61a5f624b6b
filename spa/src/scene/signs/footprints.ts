import type { Balance, Slide } from '../../twin/balance/balance.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { type BalancePaints, drawLine, faint, fillPolygon } from './balance_shapes.ts';
import type { Facets, Paint } from './strokes.ts';

/** How long footprints and trace are kept, s. */
export const KEPT_S = 10;
const MOST_POINTS = 200;
const MOST_PRINTS = 40;
/** Minimum interval between points of the trace, s. */
const EVERY_S = KEPT_S / MOST_POINTS;
/** A larger move between two poses, in radii of the robot, means that the robot was placed elsewhere. */
const LEAP = 0.35;
/** Sizes in radii of the robot. */
const TRACE = 0.006;
const OUTLINE = 0.005;
const STRONGEST = 0.6;
const FILL = 0.25;

interface TracePoint {
  at: Vec3;
  readonly tS: number;
}

interface Footprint {
  corners: readonly Vec3[];
  /** When the foot was lifted. */
  readonly tS: number;
}

/** The marks that a robot has left on the floor in the last ten seconds: the path of its projected centre of mass, and its
 *  footprints. */
export class Footprints {
  #trace: TracePoint[] = [];
  #prints: Footprint[] = [];
  /** The place of each foot that bears weight. */
  #standing = new Map<string, readonly Vec3[]>();
  #tS = Number.NaN;

  get prints(): number {
    return this.#prints.length;
  }

  get points(): number {
    return this.#trace.length;
  }

  /**
   * Takes the balance of the next pose, at `tS` (the robot's time, seconds). Poses are skipped if it is unknown which feet bear
   * weight. `anchored`: the robot reports its position in the world. Otherwise the foot that keeps bearing weight is assumed to
   * stand still, and all marks move with it; without such a foot they are dropped.
   */
  take({ feet, slide, centreOfMass, floorM }: Balance, tS: number, anchored: boolean, reach: number): void {
    if (tS === this.#tS || feet.some(({ bears }) => bears === null)) return;
    if (tS < this.#tS || (!anchored && slide === null)) {
      this.#trace = [];
      this.#prints = [];
      this.#standing.clear();
    } else if (!anchored && slide) this.#move(slide);
    this.#tS = tS;
    const stands = new Map<string, readonly Vec3[]>();
    for (const { name, bears, corners } of feet) {
      const stood = this.#standing.get(name);
      if (bears) stands.set(name, stood ?? corners);
      else if (stood !== undefined) this.#prints.push({ corners: stood, tS });
    }
    this.#standing = stands;
    if (centreOfMass !== null && floorM !== null)
      this.#step([centreOfMass[0], centreOfMass[1], floorM], tS, reach);
    const isKept = (left: { readonly tS: number }) => tS - left.tS <= KEPT_S;
    this.#trace = this.#trace.filter(isKept).slice(-MOST_POINTS);
    this.#prints = this.#prints.filter(isKept).slice(-MOST_PRINTS);
  }

  /** Draws them at height `z`; older ones are fainter. */
  draw(facets: Facets, z: number, reach: number, { mass, support }: BalancePaints): void {
    const seen = (tS: number) => STRONGEST * Math.max(0, 1 - (this.#tS - tS) / KEPT_S);
    const left = (paint: Paint, opacity: number) => ({ ...faint(paint, opacity), through: false });
    for (const { corners, tS } of this.#prints) {
      const flat = corners.map(([x, y]): Vec3 => [x, y, z]);
      fillPolygon(facets, flat, left(support, seen(tS) * FILL));
      drawLine(facets, flat, OUTLINE * reach, left(support, seen(tS)), { closed: true });
    }
    const way = this.#trace.map(({ at: [x, y] }): Vec3 => [x, y, z]);
    drawLine(facets, way, TRACE * reach, (i) => left(mass, seen(this.#trace[i]!.tS)));
  }

  #step(at: Vec3, tS: number, reach: number): void {
    const last = this.#trace.at(-1);
    if (last !== undefined) {
      const far = Math.hypot(at[0] - last.at[0], at[1] - last.at[1]);
      if (far > LEAP * reach) {
        this.#trace = [];
        this.#prints = [];
      } else if (tS - last.tS < EVERY_S || far < TRACE * reach) return;
    }
    this.#trace.push({ at, tS });
  }

  #move(slide: Slide): void {
    for (const point of this.#trace) point.at = slide(point.at);
    for (const print of this.#prints) print.corners = print.corners.map(slide);
    for (const [name, corners] of this.#standing) this.#standing.set(name, corners.map(slide));
  }
}
