import type { Level } from '@posecast/wire';
import { BalanceReader } from '../../model/balance/balance_reader.ts';
import type { PosedBody } from '../../model/posed_body.ts';
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
import { paintsOf } from './paints.ts';
import { drawPressure } from './pressure.ts';
import { drawSupport, type MarginLine, marginLine } from './support.ts';

/** Height over the floor at which signs lie, in radii of the robot. */
const LIFT = 0.006;

/** The signs of balance of one robot, for the pose that is shown. */
export class BalanceOverlay implements BalanceDrawing {
  shown: ShownBalance | null = null;
  readonly #facets: Facets;
  readonly #jointLimits: () => DrawJointLimits | null;
  #reader: BalanceReader | null = null;
  /** The judge that the page's words have, so that both have one level. */
  #judge = new StanceJudge();
  #limits: MarginLimits = marginLimits(null);
  #left = new Footprints();
  /** The way to the pose that is at rest, once it has been taken. */
  #led: unknown = null;
  #labels: OverlayLabel[] = [];

  /** `facets`: where it is drawn, with that of the other robots of the picture. `jointLimits`: what draws the limits of
   *  the selected joint; null until its code is here. */
  constructor(facets: Facets, jointLimits: () => DrawJointLimits | null) {
    this.#facets = facets;
    this.#jointLimits = jointLimits;
  }

  draw(body: PosedBody | null, pose: Pose | null, readings: BalanceReadings, style: BalanceStyle): void {
    this.shown = null;
    this.#labels = [];
    if (body === null || pose === null) return;
    const tS = pose.tS ?? 0;
    const reader = this.#readerOf(body, readings, tS, style.reach);
    if (readings.choice === 'auto' && !reader.onByItself) return;
    const facets = this.#facets;
    const balance = reader.ofBody(body, reader.wrenchesOf(pose.wrenches ?? []), tS, pose);
    this.#left.take(balance, tS, readings.anchored, style.reach);
    const level = this.#levelOf(readings, balance);
    const paints = paintsOf(style, level);
    const { reach } = style;
    const { elements } = body.root.matrixWorld;
    const heading = Math.atan2(elements[1]!, elements[0]!);
    const ahead: Vec3 = [Math.cos(heading), Math.sin(heading), 0];
    const { centreOfMass, capturePoint, floorM } = balance;
    const lift = LIFT * reach;
    const z = (floorM ?? 0) + lift;
    const foot: Vec3 | null =
      centreOfMass === null || floorM === null ? null : [centreOfMass[0], centreOfMass[1], z];
    const margin = marginLine(balance, z);
    if (floorM !== null) {
      this.#left.draw(facets, z, reach, paints);
      const sign = drawSupport(facets, balance, margin, level, z, reach, paints);
      if (margin !== null) this.#labels.push(marginLabel(margin, sign, balance, level, style.live));
      drawPressure(facets, balance, z, lift, reach, paints);
    }
    if (foot !== null) {
      if (capturePoint !== null) drawCapture(facets, foot, capturePoint, ahead, reach, paints);
      drawMassFoot(facets, foot, ahead, reach, paints);
    }
    const joints = this.#jointLimits()?.(facets, body, readings.joints, style, paints) ?? [];
    if (centreOfMass !== null) drawMass(facets, centreOfMass, foot, ahead, reach, paints);
    this.#labels.push(...joints.map(({ label }) => label));
    this.shown = {
      ...balance, // a copy: the balance is rewritten with the next pose
      feet: balance.feet.map((foot) => ({ ...foot })),
      ...{ level, footprints: this.#left.prints, trace: this.#left.points },
      joints: joints.map(({ shown }) => shown),
    };
  }

  labels(): OverlayLabel[] {
    return this.#labels;
  }

  /** The reader of the pose at `tS`. Once in the past at rest it is one that has read what led up to that pose: the signs are then
   *  those of a moment that was played to, and have the level of the words, which come from the same. */
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
        this.#levelOf(readings, balance);
      }
    }
    return reader;
  }

  #levelOf({ limits }: BalanceReadings, balance: Balance): Level {
    if (limits === null) this.#limits = marginLimits(null);
    else if (limits !== this.#limits.threshold) this.#limits = limitsBy(limits, 'profile');
    return this.#judge.next(balance, 0, this.#limits)?.level ?? 'ok';
  }
}

function marginLabel(
  { foot, edge }: MarginLine,
  sign: Vec3 | undefined,
  { marginM, polygon }: Balance,
  level: Level,
  live: boolean,
): OverlayLabel {
  const mm = Math.round(marginM! * 1000);
  const text = `${mm} mm`.replace('-', '−');
  const corners = polygon.map(([x, y]): Vec3 => [x, y, edge[2]]);
  const outline = corners.map((from, i) => [from, corners[(i + 1) % corners.length]!] as const);
  const lines: OverlayLabel['lines'] = [[foot, edge], [edge, sign ?? edge], ...outline];
  return { key: 'margin', text, level, quiet: false, old: !live, at: edge, middle: foot, lines };
}
