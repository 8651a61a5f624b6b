import type { Level } from '@posecast/wire';
import { BalanceReader } from '../../../model/balance/balance_reader.ts';
import type { PosedBody } from '../../../model/posed_body.ts';
import type { Balance } from '../../../twin/balance/balance.ts';
import { limitsBy, type MarginLimits, marginLimits, StanceJudge } from '../../../twin/balance/stance.ts';
import type { BalanceReadings } from '../../../twin/overlay/reader.ts';
import type { Pose } from '../../../twin/playback/pose.ts';
import type { Vec3 } from '../../../twin/rotation.ts';
import type { BalanceDrawing, BalancePicture, BalanceStyle, ShownBalance } from '../balance_drawing.ts';
import type { OverlayLabel } from '../labels.ts';
import { Footprints } from './footprints.ts';
import { drawJointLimits } from './joint_arc.ts';
import { drawCapture, drawMass, drawMassFoot, drawPressure } from './mass.ts';
import { Facets, paintsOf } from './shapes.ts';
import { drawSupport, type MarginLine, marginLine } from './support.ts';

/** Height of the signs above the floor, in radii of the robot. */
const LIFT = 0.006;

/** The balance signs of one robot, for the displayed pose. */
export class BalanceOverlay implements BalanceDrawing {
  shown: ShownBalance | null = null;
  readonly #facets: Facets;
  #reader: BalanceReader | null = null;
  /** The same judge as for the page's text, so that both show the same level. */
  #judge = new StanceJudge();
  #limits: MarginLimits = marginLimits(null);
  #left = new Footprints();
  /** The states that led up to the pose at rest, once processed. */
  #led: unknown = null;
  #labels: OverlayLabel[] = [];

  /** `facets`: the render target, shared by all robots of the picture. */
  constructor(facets: Facets) {
    this.#facets = facets;
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
    const joints = drawJointLimits(facets, body, readings.joints, style, paints);
    if (centreOfMass !== null) drawMass(facets, centreOfMass, foot, ahead, reach, paints);
    this.#labels.push(...joints.map(({ label }) => label));
    this.shown = {
      ...balance, // a copy, because the balance is overwritten with the next pose
      feet: balance.feet.map((foot) => ({ ...foot })),
      ...{ level, footprints: this.#left.prints, trace: this.#left.points },
      joints: joints.map(({ shown }) => shown),
    };
  }

  labels(): OverlayLabel[] {
    return this.#labels;
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

/** Creates the object that draws the balance of all robots in one picture. */
export function makeBalance(): BalancePicture {
  const facets = new Facets();
  return {
    facets,
    begin: () => facets.begin(),
    end: () => facets.end(),
    addRobot: () => new BalanceOverlay(facets),
  };
}
