import type { Level, Schema } from '@posecast/wire';
import { BalanceReader } from '../../model/balance/balance_reader.ts';
import type { PosedBody } from '../../model/posed_body.ts';
import { normalize } from '../../model/vectors.ts';
import type { Balance } from '../../twin/balance/balance.ts';
import { limitsBy, type MarginLimits, marginLimits } from '../../twin/balance/told/margin_limits.ts';
import { StanceJudge } from '../../twin/balance/told/stance.ts';
import type { BalanceReadings } from '../../twin/overlay/reader.ts';
import type { Pose } from '../../twin/playback/pose.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import type { BalanceDrawing, BalanceStyle, ShownBalance } from '../balance_drawing.ts';
import type { OverlayLabel } from '../labels.ts';
import type { Facets } from './facets.ts';
import { Footprints } from './footprints.ts';
import type { DrawJointLimits } from './joint_arc.ts';
import { drawCapture, drawMass, drawMassFoot } from './mass.ts';
import { type BalancePaints, paintsOf } from './paints.ts';
import { drawPressure } from './pressure.ts';
import { drawSupport, type MarginLine, marginLine } from './support.ts';

/** Height over the floor at which signs lie, in radii of the robot. */
const LIFT = 0.006;

const NOTHING: ShownBalance = {
  ...{ centreOfMass: null, capturePoint: null, floorM: null, ground: null, polygon: [], nearestEdge: null },
  ...{ marginM: null, level: 'ok', pressure: null, feet: [], footprints: 0, trace: 0, joints: [] },
};

/** The signs of balance of one robot, for the pose that is shown. */
export class BalanceOverlay implements BalanceDrawing {
  shown: ShownBalance = NOTHING;
  readonly #facets: Facets;
  readonly #jointLimits: () => DrawJointLimits | null;
  #reader: BalanceReader | null = null;
  #readFor: readonly [PosedBody['manifest'], Schema] | null = null;
  /** The judge that the page's words have, so that both have one level. */
  #judge = new StanceJudge();
  #limits: MarginLimits = marginLimits(null);
  readonly #left = new Footprints();
  #labels: OverlayLabel[] = [];

  /** `facets`: where it is drawn, with that of the other robots of the picture. `jointLimits`: what draws the limits of
   *  the selected joint; null until its code is here. */
  constructor(facets: Facets, jointLimits: () => DrawJointLimits | null) {
    this.#facets = facets;
    this.#jointLimits = jointLimits;
  }

  draw(body: PosedBody | null, pose: Pose | null, readings: BalanceReadings, style: BalanceStyle): void {
    this.shown = NOTHING;
    this.#labels = [];
    const reader = body === null ? null : this.#readerOf(body, readings.schema);
    if (body === null || pose === null || reader === null) return;
    if (readings.choice === 'auto' && !reader.onByItself) return;
    const facets = this.#facets;
    const tS = pose.tS ?? 0;
    const balance = reader.ofBody(body, reader.wrenchesOf(pose.wrenches ?? []), tS);
    this.#left.take(balance, tS, readings.anchored, style.reach);
    const level = this.#levelOf(readings, balance);
    const paints = paintsOf(style, level);
    const ahead = aheadOf(body);
    const lift = LIFT * style.reach;
    const z = (balance.floorM ?? 0) + lift;
    const drawn = this.#drawFloor(facets, balance, level, z, ahead, style, paints);
    const joints = this.#jointLimits()?.(facets, body, readings.joints, style, paints) ?? [];
    this.#labels.push(...joints.map(({ label }) => label));
    const { centreOfMass, floorM } = balance;
    if (centreOfMass !== null) {
      const foot: Vec3 | null = floorM === null ? null : [centreOfMass[0], centreOfMass[1], z];
      drawMass(facets, centreOfMass, foot, ahead, style.reach, paints);
    }
    if (drawn !== null) this.#labels.unshift(marginLabel(drawn, balance, level, style.live));
    this.shown = { ...shownOf(balance, this.#left), level, joints: joints.map(({ shown }) => shown) };
  }

  labels(): OverlayLabel[] {
    return this.#labels;
  }

  #readerOf({ manifest }: PosedBody, schema: Schema): BalanceReader {
    if (this.#reader === null || this.#readFor?.[0] !== manifest || this.#readFor[1] !== schema) {
      this.#reader = new BalanceReader(manifest, schema);
      this.#readFor = [manifest, schema];
      this.#judge = new StanceJudge();
      this.#left.forget();
    }
    return this.#reader;
  }

  #levelOf({ limits }: BalanceReadings, balance: Balance): Level {
    if (limits === null) this.#limits = marginLimits(null);
    else if (limits !== this.#limits.threshold) this.#limits = limitsBy(limits, 'profile');
    return this.#judge.next(balance, 0, this.#limits)?.level ?? 'ok';
  }

  /** Draws what lies on the floor; returns where the margin is measured, and where the sign of its level is. */
  #drawFloor(
    facets: Facets,
    balance: Balance,
    level: Level,
    z: number,
    ahead: Vec3,
    { reach }: BalanceStyle,
    paints: BalancePaints,
  ): DrawnMargin | null {
    const { centreOfMass, capturePoint, floorM } = balance;
    if (floorM === null) return null;
    const margin = marginLine(balance, z);
    this.#left.draw(facets, z, reach, paints);
    const sign = drawSupport(facets, balance, margin, level, z, reach, paints);
    drawPressure(facets, balance, z, LIFT * reach, reach, paints);
    if (centreOfMass === null) return null;
    const foot: Vec3 = [centreOfMass[0], centreOfMass[1], z];
    if (capturePoint !== null) drawCapture(facets, foot, capturePoint, ahead, reach, paints);
    drawMassFoot(facets, foot, ahead, reach, paints);
    return margin && { ...margin, sign };
  }
}

/** Where the margin is measured, and where the sign of its level is. */
interface DrawnMargin extends MarginLine {
  readonly sign: Vec3 | undefined;
}

/** Where the robot faces, on the floor. */
function aheadOf({ root }: PosedBody): Vec3 {
  const { elements } = root.matrixWorld;
  const ahead = normalize([elements[0]!, elements[1]!, 0]);
  return ahead[0] === 0 && ahead[1] === 0 ? [1, 0, 0] : ahead;
}

function marginLabel(
  { foot, edge, sign }: DrawnMargin,
  { marginM, polygon }: Balance,
  level: Level,
  live: boolean,
): OverlayLabel {
  const mm = Math.round(marginM! * 1000);
  const text = `${mm < 0 ? '−' : ''}${Math.abs(mm)} mm`;
  const corners = polygon.map(([x, y]): Vec3 => [x, y, edge[2]]);
  const outline = corners.map((from, i) => [from, corners[(i + 1) % corners.length]!] as const);
  const lines: OverlayLabel['lines'] = [[foot, edge], [edge, sign ?? edge], ...outline];
  return { key: 'margin', text, level, quiet: false, old: !live, at: edge, middle: foot, lines };
}

/** A copy: the balance is rewritten with the next pose. */
function shownOf(balance: Balance, left: Footprints): Omit<ShownBalance, 'level' | 'joints'> {
  return {
    ...balance,
    ...{ footprints: left.prints, trace: left.points },
    feet: balance.feet.map(({ name, bears, pressure, atEdge }) => ({ name, bears, pressure, atEdge })),
  };
}
