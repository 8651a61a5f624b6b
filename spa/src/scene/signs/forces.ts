import type { Level, Schema } from '@posecast/wire';
import { prefersReducedMotion } from '../../browser/painting.ts';
import {
  addScaled,
  cross,
  directionThrough,
  dot,
  normalize,
  pointThrough,
  rejectFrom,
  rotateAbout,
} from '../../model/vectors.ts';
import { displayOf, formatNumber } from '../../twin/format.ts';
import { worseOf } from '../../twin/limits.ts';
import { quatOfRpy, rotateVector, type Vec3 } from '../../twin/rotation.ts';
import { type Arrow, WrenchTable } from '../../twin/sensors/wrenches.ts';
import {
  levelPaint,
  type Sign,
  type SignFrame,
  type SignLabel,
  type SignLanguage,
  type SignPicture,
} from './sign.ts';
import type { Paint } from './strokes.ts';

/** Lengths in radii of the robot. */
const AT_LIMIT = 0.5;
const SHAFT = 0.012;
const HEAD = 0.066;
const HEAD_WIDE = 0.033;
const FLANGE = 0.045;
const ARC = 0.15;
const ARC_THICK = 0.008;
/** Maximum arrow length, as a multiple of the length at the limit: beyond the limit it is red, and its label has the number. */
const MOST = 1.6;
/** Sweep of the arc of a moment at its limit, rad. */
const SWEEP_AT_LIMIT = 1.5 * Math.PI;
const MOST_SWEEP = 1.85 * Math.PI;
/** Below this fraction of the limit nothing is drawn. */
const LEAST = 0.015;
/** Number of arrow heads for each level, so that colour is not the only cue. */
const HEADS: Readonly<Record<Level, number>> = { ok: 1, caution: 2, fault: 3 };
const SMOOTH_SECONDS = 0.08;
const SETTLED = 0.002;

/** Eases a length (relative to `Arrow.much`) to its newest value, because a gliding arrow is easier to follow than one
 *  that jumps. Colours change at once. */
class Glide {
  shown = 0;
  #goal = 0;

  follow({ vector, much }: Arrow, atOnce: boolean): void {
    this.#goal = vector === null ? 0 : Math.hypot(...vector) / much;
    if (atOnce) this.shown = this.#goal;
  }

  advance(seconds: number): boolean {
    if (this.shown === this.#goal) return false;
    this.shown += (this.#goal - this.shown) * -Math.expm1(-seconds / SMOOTH_SECONDS);
    if (Math.abs(this.#goal - this.shown) < SETTLED) this.shown = this.#goal;
    return true;
  }
}

/** The data of a displayed arrow, for tests and labels. */
export interface ShownArrow {
  readonly level: Level;
  /** N or N·m; signed if the robot measures one axis only; null without a reading. */
  readonly value: number | null;
  /** Metres from the sensor to the tip; for a moment, the swept angle, rad. */
  readonly size: number;
}

export interface ShownWrench {
  readonly site: string;
  readonly name: string;
  /** null if the robot measures none. */
  readonly force: ShownArrow | null;
  readonly moment: ShownArrow | null;
  /** The position of its sensor, and the anchor of its label (world, metres). */
  readonly at: Vec3;
  readonly tip: Vec3;
  /** The lines drawn for it (world, metres): the arrow, and chords of the moment's arc. */
  readonly lines: readonly (readonly [Vec3, Vec3])[];
}

/** A sensor's place in the world. */
interface Sensor {
  readonly at: Vec3;
  /** Rotates a direction from the sensor's axes to the world; zero stays zero. */
  inWorld(direction: Vec3): Vec3;
}

/** Forces as arrows and moments as arcs at their sensors, with their values. */
export class Forces implements Sign {
  static readonly key = 'wrenches';
  static readonly menu = {
    name: { en: 'Forces and moments', ko: '힘과 모멘트' },
    explain: 'signs.force',
    setting: 'forces',
  } as const;
  readonly drawn: ShownWrench[] = [];
  readonly #table: WrenchTable;
  readonly #glides: readonly { readonly force: Glide; readonly moment: Glide }[];

  constructor(schema: Schema) {
    this.#table = new WrenchTable(schema);
    this.#glides = this.#table.wrenches.map(() => ({ force: new Glide(), moment: new Glide() }));
  }

  static can(schema: Schema): boolean {
    return new WrenchTable(schema).wrenches.length > 0;
  }

  read({ codes, limits }: SignFrame): void {
    const atOnce = prefersReducedMotion();
    this.#table.read(codes, limits).forEach(({ force, moment }, i) => {
      this.#glides[i]!.force.follow(force, atOnce);
      this.#glides[i]!.moment.follow(moment, atOnce);
    });
  }

  advance(seconds: number): boolean {
    let moved = false;
    for (const { force, moment } of this.#glides) {
      moved = force.advance(seconds) || moved;
      moved = moment.advance(seconds) || moved;
    }
    return moved;
  }

  draw(picture: SignPicture): void {
    const { body, colors, feet } = picture;
    this.drawn.length = 0;
    this.#table.wrenches.forEach(({ site, name, mount, force, moment }, i) => {
      const worldFromLink = body.linkMatrix(mount.link ?? '')?.elements;
      if (worldFromLink === undefined) return; // a link that this model does not have
      const linkFromSensor = quatOfRpy(mount.rpy);
      const sensor: Sensor = {
        at: pointThrough(worldFromLink, mount.xyz),
        inWorld: (direction) => directionThrough(worldFromLink, rotateVector(linkFromSensor, direction)),
      };
      const silent = force.level === 'ok' && (lacks(force) || lacks(moment));
      const unread = { color: colors.stale, through: true };
      // balance draws its own marks at feet
      if (silent || !feet.some((foot) => foot.name === site))
        drawFlange(picture, sensor, silent ? unread : levelPaint(picture, force.level));
      const glides = this.#glides[i]!;
      const arrow = drawForce(picture, sensor, force, glides.force.shown);
      const { sweep, lines } = drawMoment(picture, sensor, moment, glides.moment.shown);
      this.drawn.push({
        site,
        name,
        force: shownOf(force, arrow.size),
        moment: shownOf(moment, sweep),
        at: sensor.at,
        tip: arrow.tip,
        lines: [[sensor.at, arrow.tip], ...lines],
      });
    });
    // so that each of two feet keeps its own side even if the robot stands on one
    const places = this.drawn.map(({ at }) => at);
    if (places.length > 0)
      picture.middle = places.reduce<Vec3>((sum, at) => addScaled(sum, at, 1 / places.length), [0, 0, 0]);
  }

  labels({ frame: { language } }: SignPicture): SignLabel[] {
    return this.drawn.flatMap((wrench) => labelOf(wrench, language));
  }
}

const NO_READING: Readonly<Record<SignLanguage, string>> = { en: 'no reading', ko: '측정값 없음' };
/** A moment with a smaller sweep (rad) gets no label while its level is ok. */
const QUIET_SWEEP = 0.35;

function labelOf(
  { site, name, force, moment, tip, lines }: ShownWrench,
  language: SignLanguage,
): SignLabel[] {
  const parts: string[] = [];
  if (force !== null) parts.push(worded(force.value, 'N', 0));
  if (moment !== null && (moment.size > QUIET_SWEEP || moment.level !== 'ok' || moment.value === null))
    parts.push(worded(moment.value, 'N·m', 1));
  if (parts.length === 0) return [];
  const quiet = force?.value === null || moment?.value === null;
  const text = quiet ? `${name}: ${NO_READING[language]}` : parts.join(' · ');
  return [
    {
      key: `wrench-${site}`,
      text,
      level: worseOf(force?.level ?? 'ok', moment?.level ?? 'ok'),
      quiet,
      at: tip,
      lines,
      explain: ['signs.force', ...(text.includes('N·m') ? ['signs.moment'] : []), 'signs.levels'],
    },
  ];
}

function worded(value: number | null, unit: string, decimals: number): string {
  if (value === null) return '—';
  const display = displayOf(unit, 'rad');
  return `${formatNumber(value, { ...display, decimals: Math.min(display.decimals, decimals) }).trim()} ${display.unit}`;
}

function shownOf(arrow: Arrow, size: number): ShownArrow | null {
  return arrow.axes.length === 0 ? null : { level: arrow.level, value: amountOf(arrow), size };
}

function lacks(arrow: Arrow): boolean {
  return arrow.axes.length > 0 && arrow.vector === null;
}

/** Draws a small ring at the sensor, so that its place is visible even if it measures nothing. */
function drawFlange({ strokes, reach }: SignPicture, { at, inWorld }: Sensor, paint: Paint): void {
  strokes.arc(at, inWorld([0, 0, 1]), inWorld([1, 0, 0]), 2 * Math.PI, reach * FLANGE, reach * 0.005, paint);
}

/** `part`: its length relative to that at the limit. */
function drawForce(
  picture: SignPicture,
  { at, inWorld }: Sensor,
  arrow: Arrow,
  part: number,
): { size: number; tip: Vec3 } {
  const { strokes, reach } = picture;
  const along = arrow.vector === null ? NOWHERE : inWorld(arrow.vector);
  if (part < LEAST || dot(along, along) < 0.5) return { size: 0, tip: at };
  const paint = levelPaint(picture, arrow.level);
  const length = Math.min(part, MOST) * AT_LIMIT * reach * picture.frame.settings.arrowScale;
  const heads = HEADS[arrow.level];
  const head = Math.min(HEAD * reach, length / (1 + 0.6 * (heads - 1)));
  const wide = HEAD_WIDE * reach * Math.sqrt(head / (HEAD * reach));
  const bare = length - head * (1 + 0.6 * (heads - 1));
  const radius = SHAFT * reach * Math.min(1, head / (HEAD * reach));
  if (bare > 0) strokes.shaft(at, along, bare + head * 0.2, radius, radius, paint);
  for (let i = 0; i < heads; i += 1) {
    strokes.shaft(addScaled(at, along, bare + head * 0.6 * i), along, head, wide, 0, paint);
  }
  return { size: length, tip: addScaled(at, along, length) };
}

/** Chords that approximate the arc of a moment. */
const CHORDS = 8;

/** Draws the arc of a moment; returns the swept angle (rad), and its chords. */
function drawMoment(
  picture: SignPicture,
  { at, inWorld }: Sensor,
  arrow: Arrow,
  part: number,
): { sweep: number; lines: [Vec3, Vec3][] } {
  const { strokes, reach } = picture;
  const axis = arrow.vector === null ? NOWHERE : inWorld(arrow.vector);
  if (part < LEAST || dot(axis, axis) < 0.5) return { sweep: 0, lines: [] };
  const paint = levelPaint(picture, arrow.level);
  const sweep = Math.min(part * SWEEP_AT_LIMIT, MOST_SWEEP);
  const radius = ARC * reach * Math.min(picture.frame.settings.arrowScale, 1.6);
  // Half on either side of the top, where it is most visible.
  const top = rejectFrom([0, 0, 1], axis);
  const start = rotateAbout(
    axis,
    -sweep / 2,
    normalize(dot(top, top) < 0.01 ? rejectFrom([1, 0, 0], axis) : top),
  );
  strokes.arc(at, axis, start, sweep, radius, ARC_THICK * reach, paint);
  const heads = HEADS[arrow.level];
  const head = HEAD * reach * 0.8 * Math.min(1, 0.4 + part * 2);
  for (let i = 0; i < heads; i += 1) {
    const away = rotateAbout(axis, sweep - (i * 0.55 * head) / radius, start);
    const along = cross(axis, away);
    strokes.shaft(
      addScaled(addScaled(at, away, radius), along, -head * 0.1),
      along,
      head,
      head * 0.45,
      0,
      paint,
    );
  }
  const on = (i: number) => addScaled(at, rotateAbout(axis, (sweep * i) / CHORDS, start), radius);
  return { sweep, lines: Array.from({ length: CHORDS }, (_, i) => [on(i), on(i + 1)]) };
}

/** The size of an arrow; signed if only one axis is measured, because pulling and pushing differ. */
function amountOf({ vector, axes }: Arrow): number | null {
  if (vector === null) return null;
  return axes.length === 1 ? vector[axes[0]!]! : Math.hypot(...vector);
}

const NOWHERE: Vec3 = [0, 0, 0];
