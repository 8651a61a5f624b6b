import type { Level } from '@posecast/wire';
import { prefersReducedMotion } from '../../browser/painting.ts';
import { expandByBox, extentOf } from '../../model/bounds.ts';
import type { PosedBody } from '../../model/posed_body.ts';
import { addScaled, originOf } from '../../model/vectors.ts';
import { type AngleUnit, coarseDisplay, displayOf, formatNumber } from '../../twin/format.ts';
import { isolated } from '../../twin/names.ts';
import type { OverlayReadings } from '../../twin/overlay/reader.ts';
import type { Pose } from '../../twin/playback/pose.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { AttitudeOverlay, type ShownAttitude } from './attitude.ts';
import type { BalanceDrawing, BalancePicture, MakeBalance, ShownBalance } from './balance_drawing.ts';
import { levelColor, type OverlayColors, type PaletteName } from './colors.ts';
import { DeviationOverlay, type ShownDeviation } from './deviations.ts';
import { JointLoadPaint } from './joint_load.ts';
import type { OverlayLabel } from './labels.ts';
import type { Paint } from './picture_numbers.ts';
import type { Strokes } from './strokes.ts';
import { type ShownWrench, WrenchOverlay } from './wrenches.ts';

/** The texts of labels in the viewer's language. */
export interface OverlayWords {
  readonly offBy: (channel: string, by: string) => string;
  readonly compliant: (channel: string) => string;
  readonly withoutReading: (name: string) => string;
}

export interface OverlayStyle {
  /** false: the pose is out of date, and the overlay is grey. */
  readonly live: boolean;
  /** The displayed joint values; deviation arcs lead from there to the other values. */
  readonly from: 'pos' | 'ref';
  /** Factor of the length of arrows; 1 is usual. */
  readonly arrowScale: number;
  readonly palette: PaletteName;
  readonly angle: AngleUnit;
  readonly words: OverlayWords;
  /** Draws the balance; null until its code has loaded. */
  readonly balance?: MakeBalance | null;
}

/** The overlay's current content, for tests and the debug interface. */
export interface ShownOverlay {
  readonly wrenches: readonly ShownWrench[];
  readonly deviations: readonly ShownDeviation[];
  readonly level: ShownAttitude;
  /** Link → #rrggbb while the body is painted by load. */
  readonly loads: Readonly<Record<string, string>>;
  /** null while the balance signs are off, or there is nothing to show. */
  readonly balance: ShownBalance | null;
}

const NOTHING: OverlayReadings = {
  ...{ wrenches: [], deviations: [], imus: [], body: null, based: false, loads: null, balance: null },
};
const UNSAID: OverlayWords = {
  offBy: (channel, by) => `${channel} ${by}`,
  compliant: (channel) => channel,
  withoutReading: (name) => name,
};
const USUAL: OverlayStyle = {
  ...{ live: false, from: 'pos', arrowScale: 1, palette: 'standard', angle: 'rad' },
  words: UNSAID,
};
/** Sort order of levels: the most important first. */
export const RANK: Readonly<Record<Level, number>> = { fault: 0, caution: 1, ok: 2 };

/** The overlay of one robot: forces, deviations, attitude and load as strokes, labels and tints. */
export class RobotOverlay {
  readonly #wrenches = new WrenchOverlay();
  readonly #deviations = new DeviationOverlay();
  readonly #attitude = new AttitudeOverlay();
  readonly #loads = new JointLoadPaint();
  #balance: BalanceDrawing | null = null;
  #readings = NOTHING;
  #manner = USUAL;
  #body: PosedBody | null = null;
  /** The robot's radius, m. Measured once, so that arrows don't change size with the pose. */
  #reach: number | null = null;

  get shown(): ShownOverlay {
    const css = (color: number) => `#${color.toString(16).padStart(6, '0')}`;
    return {
      wrenches: [...this.#wrenches.shown],
      deviations: [...this.#deviations.shown],
      level: this.#attitude.shown,
      loads: Object.fromEntries([...this.#loads.shown].map(([link, color]) => [link, css(color)])),
      balance: this.#balance?.shown ?? null,
    };
  }

  /** The body's lean, the display unit, and whether the pose is out of date; null for a robot without a sensor for it. */
  get lean(): (ShownAttitude & { readonly angle: AngleUnit; readonly old: boolean }) | null {
    const { angle, live } = this.#manner;
    return this.#readings.body === null ? null : { ...this.#attitude.shown, angle, old: !live };
  }

  /** Takes the newest readings and their style. `balance`: the render target for its balance; null if there is none yet. */
  take(
    readings: OverlayReadings | null,
    manner: OverlayStyle = this.#manner,
    balance: BalancePicture | null = null,
  ): void {
    this.#readings = readings ?? NOTHING;
    this.#manner = manner;
    this.#wrenches.take(this.#readings.wrenches, prefersReducedMotion());
    if (this.#readings.balance === null) this.#balance = null;
    else this.#balance ??= balance?.addRobot() ?? null;
  }

  /** Measures the robot's size again, for example after more of its meshes have loaded. */
  measure(): void {
    this.#reach = null;
  }

  /** Advances the easing of arrows. True while it continues. */
  advance(seconds: number): boolean {
    return this.#wrenches.advance(seconds);
  }

  /** Adds its strokes, and its balance in a pose, to a picture, and tints the body. True if the body's colours changed. */
  draw(strokes: Strokes, body: PosedBody | null, pose: Pose | null, tones: OverlayColors): boolean {
    if (body !== this.#body) this.#reach = null;
    this.#body = body;
    this.#reach ??= body === null ? null : reachOf(body);
    const reach = this.#reach ?? 0;
    const { deviations, imus, body: lean, based, loads, balance } = this.#readings;
    const { arrowScale, palette, angle, from, live } = this.#manner;
    if (balance !== null) this.#balance?.draw(body, pose, balance, { reach, tones, palette, angle, live });
    const color = (level: Level) => levelColor(tones, palette, level, live);
    const solid = (level: Level): Paint => ({ color: color(level), through: true });
    const shown = this.#balance?.shown;
    const unread = { color: tones.stale, through: true };
    this.#wrenches.draw(strokes, body, reach, arrowScale, solid, unread, shown?.feet);
    this.#deviations.draw(strokes, body, deviations, from, reach, ({ compliant }) => {
      const tone = compliant || !live ? tones.muted : color('caution');
      return { line: { color: tone, through: true }, fill: { color: tone, opacity: 0.34, through: true } };
    });
    const line: Paint = { color: live ? tones.level : tones.stale, through: true };
    const ground = shown?.floorM == null;
    this.#attitude.draw(strokes, body, imus, lean, based, reach, {
      plane: { color: line.color, opacity: 0.07 },
      rim: { color: line.color, opacity: ground ? 0.8 : 0.25 },
      gravity: line,
      faint: { color: line.color, opacity: 0.55, through: true },
      lean: { color: line.color, opacity: 0.3, through: true },
      ground,
    });
    return this.#loads.paint(body, loads, color('fault'));
  }

  /** The labels for the strokes of the newest `draw`. */
  labels(): OverlayLabel[] {
    const middle = this.#middle();
    const labels = this.#wrenches.shown.flatMap((wrench) => wrenchLabel(wrench, middle, this.#manner));
    for (const { channel, error, unit, compliant, at, lines } of this.#deviations.shown) {
      if (at === null) continue;
      const display = displayOf(unit, this.#manner.angle);
      const off = formatNumber(Math.abs(error), coarseDisplay(display)).trim();
      const { words } = this.#manner;
      const text = compliant
        ? words.compliant(isolated(channel))
        : words.offBy(isolated(channel), `${off} ${display.unit}`);
      labels.push({
        key: `apart-${channel}`,
        text,
        level: compliant ? 'ok' : 'caution',
        quiet: compliant,
        old: !this.#manner.live,
        at,
        middle,
        lines,
      });
    }
    labels.push(...(this.#balance?.labels() ?? []));
    return labels;
  }

  /** The reference point for the outer side of labels: the middle of the force sensors, so that each of two feet keeps its own
   *  side even if the robot stands on one; without such sensors, the root. */
  #middle(): Vec3 {
    const sensors = this.#wrenches.shown.map(({ at }) => at);
    if (this.#body !== null && sensors.length === 0)
      sensors.push(originOf(this.#body.root.matrixWorld.elements));
    return meanOf(sensors);
  }
}

/** The mean of points. */
function meanOf(points: readonly Vec3[]): Vec3 {
  return points.reduce<Vec3>((sum, point) => addScaled(sum, point, 1 / points.length), [0, 0, 0]);
}

/** A moment with a smaller sweep (rad) gets no label while its level is ok. */
const QUIET_SWEEP = 0.35;

function wrenchLabel(
  { site, name, force, moment, tip, lines }: ShownWrench,
  middle: Vec3,
  { words, live }: OverlayStyle,
): OverlayLabel[] {
  const parts: string[] = [];
  if (force !== null) parts.push(said(force.value, 'N', 0));
  if (moment !== null && (moment.size > QUIET_SWEEP || moment.level !== 'ok' || moment.value === null))
    parts.push(said(moment.value, 'N·m', 1));
  if (parts.length === 0) return [];
  const [f, m] = [force?.level ?? 'ok', moment?.level ?? 'ok'];
  const unread = force?.value === null || moment?.value === null;
  return [
    {
      key: `wrench-${site}`,
      text: unread ? words.withoutReading(name) : parts.join(' · '),
      level: RANK[f] < RANK[m] ? f : m,
      quiet: unread,
      old: !live,
      at: tip,
      middle,
      lines,
    },
  ];
}

function said(value: number | null, unit: string, decimals: number): string {
  if (value === null) return '—';
  const display = displayOf(unit, 'rad');
  return `${formatNumber(value, { ...display, decimals: Math.min(display.decimals, decimals) }).trim()} ${display.unit}`;
}

/** The radius of a robot's bounding box, m. */
function reachOf(body: PosedBody): number {
  const min: [number, number, number] = [Infinity, Infinity, Infinity];
  const max: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  for (const [link, box] of body.boxes) expandByBox(min, max, box, link.matrixWorld.elements, 0);
  for (const name of body.linkNames) {
    const { elements } = body.linkMatrix(name)!;
    for (let axis = 0; axis < 3; axis += 1) {
      min[axis] = Math.min(min[axis]!, elements[12 + axis]!);
      max[axis] = Math.max(max[axis]!, elements[12 + axis]!);
    }
  }
  return extentOf(min, max).radius;
}
