import type { Balance } from '../../twin/balance/balance.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import type { Paint } from '../strokes.ts';
import type { Facets } from './facets.ts';
import { type BalancePaints, faint } from './paints.ts';
import { drawLine, fillPolygon } from './shapes.ts';

/** How long footprints and trace are kept, s. */
export const KEPT_S = 10;
const MOST_POINTS = 200;
const MOST_PRINTS = 40;
/** Points of the trace are at least so far apart, s. */
const EVERY_S = KEPT_S / MOST_POINTS;
/** From one pose to the next nothing walks so far, in radii of the robot: it was put elsewhere. */
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
  /** When the foot left it. */
  readonly tS: number;
}

/** What a robot has left on the floor in the last ten seconds: the way of its mass' foot, and where its feet stood. */
export class Footprints {
  #trace: TracePoint[] = [];
  #prints: Footprint[] = [];
  /** Where each foot stands that bears. */
  #standing = new Map<string, readonly Vec3[]>();
  #tS = Number.NaN;

  get prints(): number {
    return this.#prints.length;
  }

  get points(): number {
    return this.#trace.length;
  }

  forget(): void {
    this.#trace = [];
    this.#prints = [];
    this.#standing.clear();
    this.#tS = Number.NaN;
  }

  /**
   * Takes the balance of the next pose, at `tS` (the robot's time, seconds). `anchored`: the robot reports where it is in
   * the world; else a foot that goes on bearing is what stands still, and the floor moves under the others.
   */
  take({ feet, centreOfMass, floorM }: Balance, tS: number, anchored: boolean, reach: number): void {
    if (tS === this.#tS) return;
    if (tS < this.#tS) this.forget();
    this.#tS = tS;
    if (!anchored) this.#followFoot(feet);
    const stands = new Map<string, readonly Vec3[]>();
    for (const { name, bears, corners } of feet) {
      const stood = this.#standing.get(name);
      if (bears === true) stands.set(name, stood ?? corners);
      else if (stood !== undefined) this.#prints.push({ corners: stood, tS });
    }
    this.#standing = stands;
    if (centreOfMass !== null && floorM !== null)
      this.#step([centreOfMass[0], centreOfMass[1], floorM], tS, reach);
    const isKept = (left: { readonly tS: number }) => tS - left.tS <= KEPT_S;
    this.#trace = this.#trace.filter(isKept).slice(-MOST_POINTS);
    this.#prints = this.#prints.filter(isKept).slice(-MOST_PRINTS);
  }

  /** Draws them at height `z`, the older the fainter. */
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

  /** Moves all that is kept as the foot has moved that stood and still bears. */
  #followFoot(feet: Balance['feet']): void {
    const foot = feet.find(({ name, bears }) => bears === true && this.#standing.has(name));
    if (foot === undefined) return;
    const move = moveBetween(this.#standing.get(foot.name)!, foot.corners);
    if (move === null) return;
    for (const point of this.#trace) point.at = move(point.at);
    for (const print of this.#prints) print.corners = print.corners.map(move);
    for (const [name, corners] of this.#standing) this.#standing.set(name, corners.map(move));
  }
}

/** The motion on the floor that takes one place of a sole to another; null for none, or a sole without extent. */
function moveBetween(before: readonly Vec3[], after: readonly Vec3[]): ((at: Vec3) => Vec3) | null {
  const [[a, b], [c, d]] = [before, after];
  if (a === undefined || b === undefined || c === undefined || d === undefined) return null;
  const turn = Math.atan2(d[1] - c[1], d[0] - c[0]) - Math.atan2(b[1] - a[1], b[0] - a[0]);
  if (turn === 0 && a[0] === c[0] && a[1] === c[1]) return null;
  const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
  return ([x, y, z]) => {
    const [dx, dy] = [x - a[0], y - a[1]];
    return [c[0] + cos * dx - sin * dy, c[1] + sin * dx + cos * dy, z];
  };
}
