import type { Ground, Level, Schema } from '@posecast/wire';
import { BalanceReader } from '../../model/balance/balance_reader.ts';
import type { PosedBody } from '../../model/posed_body.ts';
import type { Balance, Vec2 } from '../../twin/balance/balance.ts';
import {
  limitsBy,
  type MarginLimits,
  marginLimits,
  type Stance,
  StanceJudge,
} from '../../twin/balance/stance.ts';
import type { Threshold } from '../../twin/limits.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import {
  drawCapture,
  drawMass,
  drawMassFoot,
  drawPressure,
  drawSupport,
  type MarginLine,
  marginLine,
} from './balance_marks.ts';
import { paintsOf } from './balance_shapes.ts';
import { Footprints } from './footprints.ts';
import { drawJointLimits, type ShownJoint } from './joint_arc.ts';
import type { SignFrame, SignLabel, SignPicture } from './sign.ts';
import type { Facets } from './strokes.ts';

/** What the signs of balance need in addition to the displayed pose. */
export interface BalanceReadings {
  readonly schema: Schema;
  readonly choice: 'auto' | 'on';
  /** Limits of the margin, mm; null for none. */
  readonly limits: Threshold | null;
  /** URDF joints whose limits are drawn. */
  readonly joints: readonly string[];
  /** Whether the robot reports its position in the world, and is shown there. */
  readonly anchored: boolean;
  /** At rest in the past: the states that led up to the displayed one, at `tS`; otherwise null. */
  readonly lead: { readonly states: NonNullable<SignFrame['lead']>; readonly tS: number } | null;
}

/** The balance signs shown now, for tests and the debug interface. Lengths are metres in the world. */
export interface ShownBalance {
  readonly centreOfMass: Vec3 | null;
  readonly capturePoint: Vec3 | null;
  readonly floorM: number | null;
  readonly ground: Ground | null;
  readonly polygon: readonly Vec2[];
  readonly nearestEdge: number | null;
  readonly marginM: number | null;
  /** The drawn level of the margin. */
  readonly level: Level;
  /** What is to be said of it; null if nothing. */
  readonly stance: Stance | null;
  /** The robot's time of its pose, s. */
  readonly tS: number;
  readonly pressure: Vec3 | null;
  readonly feet: readonly {
    readonly name: string;
    readonly bears: boolean | null;
    readonly pressure: Vec3 | null;
    readonly atEdge: boolean;
  }[];
  /** The number of footprints, and of trace points. */
  readonly footprints: number;
  readonly trace: number;
  readonly joints: readonly ShownJoint[];
}

/** Height of the signs above the floor, in radii of the robot. */
const LIFT = 0.006;

/** The balance signs of one robot, for the displayed pose. */
export class BalanceDrawing {
  /** null while there is nothing to show. */
  shown: ShownBalance | null = null;
  labels: readonly SignLabel[] = [];
  #reader: BalanceReader | null = null;
  /** The same judge as for the page's text, so that both show the same level. */
  #judge = new StanceJudge();
  #limits: MarginLimits = marginLimits(null);
  #left = new Footprints();
  /** The states that led up to the pose at rest, once processed. */
  #led: unknown = null;

  draw(picture: SignPicture, facets: Facets, readings: BalanceReadings): void {
    const { body, pose, reach } = picture;
    this.shown = null;
    this.labels = [];
    if (pose === null) return;
    const tS = pose.tS ?? 0;
    const reader = this.#readerOf(body, readings, tS, reach);
    if (readings.choice === 'auto' && !reader.onByItself) return;
    const balance = reader.ofBody(body, reader.wrenchesOf(pose.wrenches ?? []), tS, pose);
    this.#left.take(balance, tS, readings.anchored, reach);
    const { elements } = body.root.matrixWorld;
    const heading = Math.atan2(elements[1]!, elements[0]!);
    const stance = this.#stanceOf(readings, balance, heading);
    const level = stance?.level ?? 'ok';
    const paints = paintsOf(picture, level);
    const ahead: Vec3 = [Math.cos(heading), Math.sin(heading), 0];
    const { centreOfMass, capturePoint, floorM } = balance;
    const lift = LIFT * reach;
    const z = (floorM ?? 0) + lift;
    const foot: Vec3 | null =
      centreOfMass === null || floorM === null ? null : [centreOfMass[0], centreOfMass[1], z];
    const margin = marginLine(balance, z);
    const labels: SignLabel[] = [];
    if (floorM !== null) {
      this.#left.draw(facets, z, reach, paints);
      const sign = drawSupport(facets, balance, margin, level, z, reach, paints);
      if (margin !== null) labels.push(marginLabel(margin, sign, balance, level));
      drawPressure(facets, balance, z, lift, reach, paints);
    }
    if (foot !== null) {
      if (capturePoint !== null) drawCapture(facets, foot, capturePoint, ahead, reach, paints);
      drawMassFoot(facets, foot, ahead, reach, paints);
    }
    const joints = drawJointLimits(facets, picture, readings.joints, paints);
    if (centreOfMass !== null) drawMass(facets, centreOfMass, foot, ahead, reach, paints);
    this.labels = [...labels, ...joints.map(({ label }) => label)];
    this.shown = {
      ...balance, // a copy, because the balance is overwritten with the next pose
      feet: balance.feet.map((foot) => ({ ...foot })),
      ...{ level, stance, tS },
      ...{ footprints: this.#left.prints, trace: this.#left.points },
      joints: joints.map(({ shown }) => shown),
    };
  }

  /** The reader for the pose at `tS`. At rest in the past, it is a reader that has processed the states leading up to that pose.
   *  The signs are then the same as if the moment had been played to, and match the level in the text, which uses the same
   *  states. */
  #readerOf({ manifest }: PosedBody, readings: BalanceReadings, tS: number, reach: number): BalanceReader {
    const { schema, lead, anchored } = readings;
    const isOther = this.#reader?.manifest !== manifest || this.#reader.schema !== schema;
    const isLed = lead?.tS === tS && lead.states !== this.#led;
    if (isOther || isLed) {
      this.#reader = new BalanceReader(manifest, schema);
      this.#judge = new StanceJudge();
      this.#left = new Footprints();
    }
    const reader = this.#reader!;
    if (isLed) {
      this.#led = lead.states;
      for (const { codes, tS } of lead.states) {
        const balance = reader.ofFrame(codes, tS);
        this.#left.take(balance, tS, anchored, reach);
        this.#stanceOf(readings, balance, reader.headingRad);
      }
    }
    return reader;
  }

  #stanceOf({ limits }: BalanceReadings, balance: Balance, headingRad: number): Stance | null {
    if (limits === null) this.#limits = marginLimits(null);
    else if (limits !== this.#limits.threshold) this.#limits = limitsBy(limits, 'profile');
    return this.#judge.next(balance, headingRad, this.#limits);
  }
}

function marginLabel(
  { foot, edge }: MarginLine,
  sign: Vec3 | undefined,
  { marginM, polygon }: Balance,
  level: Level,
): SignLabel {
  const mm = Math.round(marginM! * 1000);
  const text = `${mm} mm`.replace('-', '−');
  const corners = polygon.map(([x, y]): Vec3 => [x, y, edge[2]]);
  const outline = corners.map((from, i) => [from, corners[(i + 1) % corners.length]!] as const);
  const lines: SignLabel['lines'] = [[foot, edge], [edge, sign ?? edge], ...outline];
  const explain = ['balance.margin', 'balance.levels'];
  return { key: 'margin', text, level, at: edge, middle: foot, lines, explain };
}
