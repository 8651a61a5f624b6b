import type { Level } from '@posecast/wire';
import { expandByBox, extentOf } from '../../model/bounds.ts';
import type { LinkTint, PosedBody } from '../../model/posed_body.ts';
import { originOf } from '../../model/vectors.ts';
import type { Pose } from '../../twin/playback/pose.ts';
import { Attitude, AttitudeReadout } from './attitude.ts';
import type { OverlayColors } from './colors.ts';
import type { LabelRoom } from './label_layout.ts';
import { type LabelPlace, type OverlayLabel, OverlayLabels } from './labels.ts';
import type { SignPicture } from './sign.ts';
import type { RobotSigns } from './signs.ts';
import { Facets, Strokes } from './strokes.ts';

/** A robot in the picture whose overlay is drawn. */
export interface OverlayBearer {
  /** null while it has no body. */
  readonly figure: PosedBody | null;
  /** The displayed pose. */
  readonly pose?: Pose | null;
}

/** Sort order of levels: the most important first. */
const RANK: Readonly<Record<Level, number>> = { fault: 0, caution: 1, ok: 2 };

const NO_TINTS: ReadonlyMap<string, LinkTint> = new Map();

/** What the overlay keeps about one robot. */
interface Drawn {
  signs: RobotSigns;
  body: PosedBody | null;
  /** The robot's radius, m. Measured once, so that arrows don't change size with the pose. */
  reach: number | null;
  /** The links of `body` that have another colour than their own. */
  tints: ReadonlyMap<string, LinkTint>;
}

/**
 * The overlay of all robots of one picture, independent of the renderer: strokes and facets for the canvas and labels over it. It
 * is rebuilt only in `make`, so that six moving robots cost one rebuild per picture.
 */
export class Overlay {
  readonly strokes = new Strokes();
  readonly facets: Facets | null;
  readonly #labels: OverlayLabels;
  readonly #readout: AttitudeReadout;
  readonly #robots = new Map<OverlayBearer, Drawn>();
  #colors: OverlayColors;
  #old = true;

  /** `facets`: whether the renderer draws facets. */
  constructor(host: HTMLElement, colors: OverlayColors, facets: boolean) {
    this.#readout = new AttitudeReadout(host.parentElement ?? host);
    this.#labels = new OverlayLabels(host, this.#readout.root);
    this.#colors = colors;
    this.facets = facets ? new Facets() : null;
  }

  /** What a robot's signs have drawn, by key. */
  drawn(of: OverlayBearer): Readonly<Record<string, unknown>> {
    return this.#robots.get(of)?.signs.drawn ?? {};
  }

  /** Takes a robot's signs whenever they have read a frame. */
  show(of: OverlayBearer, signs: RobotSigns): void {
    const known = this.#robots.get(of);
    if (known === undefined) this.#robots.set(of, { signs, body: null, reach: null, tints: NO_TINTS });
    else known.signs = signs;
    this.#old = true;
  }

  /** Call this when a robot has moved or its body has changed. */
  moved(): void {
    this.#old = true;
  }

  /** Measures the robots' sizes again, for example after more of their meshes have loaded. */
  measure(): void {
    for (const robot of this.#robots.values()) robot.reach = null;
    this.#old = true;
  }

  setColors(colors: OverlayColors): void {
    this.#colors = colors;
    this.#old = true;
  }

  /** Advances the easing of arrows. True while it continues. */
  advance(seconds: number): boolean {
    let moving = false;
    for (const { signs } of this.#robots.values()) moving = signs.advance(seconds) || moving;
    this.#old ||= moving;
    return moving;
  }

  /** Rebuilds strokes and labels if needed. True if that changes the picture. */
  make(): boolean {
    if (!this.#old) return false;
    this.#old = false;
    this.strokes.begin();
    this.facets?.begin();
    const [...robots] = this.#robots;
    let isPainted = false;
    const labels = robots.flatMap(([bearer, robot], i) => {
      const [found, painted] = this.#draw(bearer, robot);
      isPainted ||= painted;
      return robots.length === 1 ? found : found.map((label) => ({ ...label, key: `${i}-${label.key}` }));
    });
    const isFilled = this.facets?.end() ?? false;
    const isStroked = this.strokes.end();
    this.#labels.set(labels.sort((a, b) => RANK[a.level] - RANK[b.level]));
    const alone = robots.length === 1 ? robots[0]![1].signs : null; // several robots have no common lean
    const { settings, live } = alone?.frame ?? {};
    this.#readout.show(alone?.of(Attitude)?.lean ?? null, settings?.angle ?? 'rad', live ?? false);
    return isStroked || isFilled || isPainted;
  }

  /** Places the labels in a picture. */
  placeLabels(place: LabelPlace, room: LabelRoom): void {
    this.#labels.place(place, room);
  }

  dispose(): void {
    this.#labels.dispose();
    this.#readout.dispose();
  }

  /** Draws the signs of one robot. Returns their labels, and whether the colours of its body have changed. */
  #draw(
    { figure: body, pose = null }: OverlayBearer,
    robot: Drawn,
  ): [labels: OverlayLabel[], painted: boolean] {
    const { frame } = robot.signs;
    if (body !== robot.body) {
      robot.body = body;
      robot.reach = null;
      robot.tints = NO_TINTS;
    }
    if (body === null) return [[], false];
    const tints = new Map<string, LinkTint>();
    const labels: OverlayLabel[] = [];
    if (frame !== null) {
      robot.reach ??= reachOf(body);
      const picture: SignPicture = {
        ...{ frame, body, pose, tints, reach: robot.reach, colors: this.#colors },
        ...{ strokes: this.strokes, facets: this.facets, feet: [], supportM: null },
        middle: originOf(body.root.matrixWorld.elements),
      };
      robot.signs.draw(picture);
      const { middle } = picture;
      for (const label of robot.signs.labels(picture)) labels.push({ middle, old: !frame.live, ...label });
    }
    const painted = paint(body, robot.tints, tints);
    robot.tints = tints;
    return [labels, painted];
  }
}

/** Replaces the tints of a body. True if that changes any. */
function paint(
  body: PosedBody,
  before: ReadonlyMap<string, LinkTint>,
  now: ReadonlyMap<string, LinkTint>,
): boolean {
  let changed = false;
  for (const link of new Set([...before.keys(), ...now.keys()])) {
    const [old, tint = null] = [before.get(link), now.get(link)];
    if (old?.color === tint?.color && old?.hatched === tint?.hatched) continue;
    body.setTint(link, tint);
    changed = true;
  }
  return changed;
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
