import type { Level, Schema } from '@posecast/wire';
import { BalanceReader } from '../../model/balance/balance_reader.ts';
import type { PosedBody } from '../../model/posed_body.ts';
import { normalize } from '../../model/vectors.ts';
import type { Balance } from '../../twin/balance/balance.ts';
import { marginLimits } from '../../twin/balance/told/margin_limits.ts';
import { coarseDisplay, displayOf, formatNumber } from '../../twin/format.ts';
import { LevelLatch } from '../../twin/limits/level_latch.ts';
import type { BalanceReadings } from '../../twin/overlay/reader.ts';
import type { Pose } from '../../twin/playback/pose.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import type { BalanceDrawing, BalanceStyle, ShownBalance } from '../balance_drawing.ts';
import type { OverlayLabel } from '../labels.ts';
import type { Facets } from './facets.ts';
import { Footprints } from './footprints.ts';
import { drawJointLimits } from './joint_arc.ts';
import { drawCapture, drawMass, drawMassFoot } from './mass.ts';
import { type BalancePaints, faint, paintsOf } from './paints.ts';
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
  #reader: BalanceReader | null = null;
  #readFor: readonly [PosedBody['manifest'], Schema] | null = null;
  readonly #latch = new LevelLatch();
  readonly #left = new Footprints();
  #labels: OverlayLabel[] = [];

  /** `facets`: where it is drawn, with that of the other robots of the picture. */
  constructor(facets: Facets) {
    this.#facets = facets;
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
    const level = levelOf(this.#latch, readings, balance);
    const paints = paintsOf(style, level);
    const ahead = aheadOf(body);
    const lift = LIFT * style.reach;
    const z = (balance.floorM ?? 0) + lift;
    const margin = this.#drawFloor(facets, balance, level, z, ahead, style, paints);
    const joints = this.#drawJoints(facets, body, readings, style, paints);
    const { centreOfMass, floorM } = balance;
    if (centreOfMass !== null) {
      const foot: Vec3 | null = floorM === null ? null : [centreOfMass[0], centreOfMass[1], z];
      drawMass(facets, centreOfMass, foot, ahead, style.reach, paints);
    }
    if (margin !== null) this.#labels.unshift(marginLabel(margin, balance, level, style.live));
    this.shown = { ...shownOf(balance, this.#left), level, joints };
  }

  labels(): OverlayLabel[] {
    return this.#labels;
  }

  #readerOf({ manifest }: PosedBody, schema: Schema): BalanceReader {
    if (this.#reader === null || this.#readFor?.[0] !== manifest || this.#readFor[1] !== schema) {
      this.#reader = new BalanceReader(manifest, schema);
      this.#readFor = [manifest, schema];
      this.#left.forget();
    }
    return this.#reader;
  }

  /** Draws what lies on the floor. */
  #drawFloor(
    facets: Facets,
    balance: Balance,
    level: Level,
    z: number,
    ahead: Vec3,
    { reach }: BalanceStyle,
    paints: BalancePaints,
  ): MarginLine | null {
    const { centreOfMass, capturePoint, floorM } = balance;
    if (floorM === null) return null;
    const margin = marginLine(balance, z);
    this.#left.draw(facets, z, reach, paints);
    drawSupport(facets, balance, margin, level, z, reach, paints);
    drawPressure(facets, balance, z, LIFT * reach, reach, paints);
    if (centreOfMass === null) return margin;
    const foot: Vec3 = [centreOfMass[0], centreOfMass[1], z];
    if (capturePoint !== null) drawCapture(facets, foot, capturePoint, ahead, reach, paints);
    drawMassFoot(facets, foot, ahead, reach, paints);
    return margin;
  }

  #drawJoints(
    facets: Facets,
    body: PosedBody,
    { joints }: BalanceReadings,
    { reach, angle, live, tones }: BalanceStyle,
    { mass }: BalancePaints,
  ): ShownBalance['joints'] {
    const accent = { color: live ? tones.accent : tones.stale, through: true };
    const paints = { way: faint(mass, 0.22), left: accent, now: mass };
    return joints.flatMap((name) => {
      const drawn = drawJointLimits(facets, body, name, reach, paints);
      if (drawn === null) return [];
      const { at, ...joint } = drawn;
      const display = displayOf(joint.slides ? 'm' : 'rad', angle);
      const text = `${formatNumber(joint.left, coarseDisplay(display)).trim()} ${display.unit}`;
      const level: Level = joint.left < 0 ? 'caution' : 'ok';
      this.#labels.push(label(`left-${name}`, text, level, live, at, [[at, at]]));
      return [joint];
    });
  }
}

/** The level of the margin by its limits, without any by those that the page's words have. */
function levelOf(latch: LevelLatch, { limits }: BalanceReadings, { marginM }: Balance): Level {
  const mm = marginM === null ? null : marginM * 1000;
  if (limits !== null || mm === null) return latch.next(limits, mm);
  return marginLimits(null).levelAt(mm);
}

/** Where the robot faces, on the floor. */
function aheadOf({ root }: PosedBody): Vec3 {
  const { elements } = root.matrixWorld;
  const ahead = normalize([elements[0]!, elements[1]!, 0]);
  return ahead[0] === 0 && ahead[1] === 0 ? [1, 0, 0] : ahead;
}

function marginLabel(
  { foot, edge }: MarginLine,
  { marginM, polygon }: Balance,
  level: Level,
  live: boolean,
): OverlayLabel {
  const mm = Math.round(marginM! * 1000);
  const text = `${mm < 0 ? '−' : ''}${Math.abs(mm)} mm`;
  const corners = polygon.map(([x, y]): Vec3 => [x, y, edge[2]]);
  const outline = corners.map((from, i) => [from, corners[(i + 1) % corners.length]!] as const);
  return label('margin', text, level, live, edge, [[foot, edge], ...outline]);
}

function label(
  key: string,
  text: string,
  level: Level,
  live: boolean,
  at: Vec3,
  lines: OverlayLabel['lines'],
): OverlayLabel {
  return { key, text, level, quiet: false, old: !live, at, middle: lines[0]?.[0] ?? at, lines };
}

/** A copy: the balance is rewritten with the next pose. */
function shownOf(balance: Balance, left: Footprints): Omit<ShownBalance, 'level' | 'joints'> {
  const { centreOfMass, capturePoint, floorM, ground, nearestEdge, marginM, pressure } = balance;
  const copy = (at: Vec3 | null): Vec3 | null => (at === null ? null : [at[0], at[1], at[2]]);
  return {
    ...{ floorM, ground, nearestEdge, marginM, footprints: left.prints, trace: left.points },
    centreOfMass: copy(centreOfMass),
    capturePoint: copy(capturePoint),
    pressure: copy(pressure),
    polygon: balance.polygon.map(([x, y]) => [x, y] as const),
    feet: balance.feet.map(({ name, bears, pressure: at, atEdge }) => ({
      name,
      bears,
      pressure: copy(at),
      atEdge,
    })),
  };
}
