import type { Level, Schema } from '@posecast/wire';
import type { LatePart } from '../../browser/late_part.ts';
import type { LinkTint, PosedBody } from '../../model/posed_body.ts';
import type { AngleUnit } from '../../twin/format.ts';
import type { ValueLimits } from '../../twin/limits.ts';
import type { JointValues, Pose } from '../../twin/playback/pose.ts';
import type { LeadState } from '../../twin/robot.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { levelColor, type OverlayColors, type PaletteName } from './colors.ts';
import type { Facets, Paint, Strokes } from './strokes.ts';

/** The settings that signs follow. */
export interface SignSettings {
  /** Which joint values the body shows. */
  shown: 'pos' | 'ref' | 'both';
  /** A ghost and arcs where ref and pos differ. */
  lens: boolean;
  /** Force and moment arrows. */
  forces: boolean;
  /** The tilt of base and IMUs. */
  level: boolean;
  /** The joint value that colours the body: motor current or temperature. */
  load: 'off' | 'cur' | 'temp';
  /** Centre of mass, support polygon and margin; `auto`: on for robots with two feet that measure forces, and with masses. */
  balance: 'auto' | 'on' | 'off';
  /** Signs without a setting of their own, by key; one that is not listed is as its `menu` says. */
  signs: Readonly<Record<string, boolean>>;
  /** A factor for the length of arrows; 1 is usual. */
  arrowScale: number;
  /** Keeps the body facing one way; the heading that its sensors measure is ignored. */
  headingLocked: boolean;
  palette: PaletteName;
  angle: AngleUnit;
}

export type SignLanguage = 'en' | 'ko';

/** A robot's newest frame, and what else signs read. */
export interface SignFrame {
  readonly schema: Schema;
  readonly codes: Int32Array;
  readonly limits: ValueLimits;
  /** Robot time, seconds. */
  readonly tS: number;
  /** At rest in the past: the states that led up to this one; otherwise null. */
  readonly lead: readonly Pick<LeadState, 'tS' | 'codes'>[] | null;
  /** The selected joint channel; null for none. */
  readonly joint: string | null;
  /** false: the pose is out of date, and all signs are grey. */
  readonly live: boolean;
  readonly settings: Readonly<SignSettings>;
  readonly language: SignLanguage;
  /** A joint channel's name as the viewer wants it, safe to show. */
  nameOf(channel: string): string;
}

/** One robot in a picture that is being made. */
export interface SignPicture {
  readonly frame: SignFrame;
  readonly body: PosedBody;
  /** The displayed pose; null before any. */
  readonly pose: Pose | null;
  /** The robot's radius, m. Sizes of signs are multiples of it, so that they suit robots of any size. */
  readonly reach: number;
  readonly colors: OverlayColors;
  readonly strokes: Strokes;
  /** null in a view that draws none. */
  readonly facets: Facets | null;
  /** By link; other links keep their own colours. */
  readonly tints: Map<string, LinkTint>;
  /** The feet that have marks of their own. Set by `Balance`. */
  feet: readonly { readonly name: string }[];
  /** The height of the soles that the support polygon is drawn at, m; null if it is not drawn. The floor that is drawn is z = 0
   *  of the world. Set by `Balance`. */
  supportM: number | null;
  /** The robot's middle (world, metres). A label is placed on the outer side of its anchor. Set by `Forces`. */
  middle: Vec3;
}

export interface SignLabel {
  /** Identifies the same label in consecutive pictures. */
  readonly key: string;
  readonly text: string;
  readonly level: Level;
  /** Shown without emphasis, because it is no fault: a joint that is compliant on purpose, or has no reading. On narrow screens,
   *  where labels of level `ok` are hidden, it stays. */
  readonly quiet?: boolean;
  /** The anchor (world, metres). */
  readonly at: Vec3;
  /** Instead of the picture's. */
  readonly middle?: Vec3;
  /** The lines drawn for it, which must not be covered (world, metres). */
  readonly lines: readonly (readonly [Vec3, Vec3])[];
  /** Keys of the explanations that a press opens. */
  readonly explain: readonly string[];
}

/** A transparent second copy of the robot: see `BodyView.showGhost`. */
export interface SignGhost {
  readonly joints: JointValues;
  readonly limbs: readonly string[];
}

/** One kind of sign on one robot, as long as it is on. */
export interface Sign {
  /** What it has drawn, for tests and the debug interface. */
  readonly drawn: unknown;
  /** Takes the newest frame. */
  read(frame: SignFrame): void;
  /** Advances easing. True while it continues. */
  advance?(seconds: number): boolean;
  draw(picture: SignPicture): void;
  /** The labels for the newest `draw`. */
  labels?(picture: SignPicture): readonly SignLabel[];
  /** The ghost that it wants; null for none. */
  readonly ghost?: SignGhost | null;
}

/** The class of a sign. A robot with a new schema gets a new one. */
export interface SignKind<S extends Sign = Sign> {
  new (schema: Schema): S;
  /** Its name in `SignSettings.signs` and in the debug interface. */
  readonly key: string;
  /** Its switch in the menu. A sign without one has an entry of its own in `app/robot/SignMenu.tsx`. */
  readonly menu?: {
    readonly name: Readonly<Record<SignLanguage, string>>;
    /** Key of its explanation. */
    readonly explain?: string;
    /** Whether it is on until the viewer switches it; by default it is. */
    readonly on?: boolean;
    /** Instead of `SignSettings.signs` and `on`: a setting of `app/state/settings.ts`, with its default there. */
    readonly setting?: 'forces' | 'lens' | 'level';
  };
  /** Code that it draws with, if that comes later. */
  readonly part?: LatePart<unknown>;
  /** Whether a robot with this schema can have it: whether it reports what the sign shows. That it has joints is not enough. */
  can(schema: Schema): boolean;
  /** Whether the viewer wants it; by default, whether its switch is on. */
  shown?(settings: SignSettings): boolean;
}

/** Whether the switch of a sign is on. */
export function isSwitchedOn({ key, menu }: SignKind, settings: SignSettings): boolean {
  return menu?.setting === undefined ? (settings.signs[key] ?? menu?.on ?? true) : settings[menu.setting];
}

/** The settings with which the switch of a sign is on or off. */
export function switched(
  { key, menu }: SignKind,
  on: boolean,
  settings: SignSettings,
): Partial<SignSettings> {
  return menu?.setting === undefined ? { signs: { ...settings.signs, [key]: on } } : { [menu.setting]: on };
}

/** A paint of the theme, grey if the pose is old. */
export function tonePaint(
  { colors, frame }: SignPicture,
  tone: 'level' | 'muted' | 'accent' | 'ink',
  opacity = 1,
  through = true,
): Paint {
  return { color: frame.live ? colors[tone] : colors.stale, opacity, through };
}

/** The paint of a level, grey if the pose is old. */
export function levelPaint({ colors, frame }: SignPicture, level: Level): Paint {
  return { color: levelColor(colors, frame.settings.palette, level, frame.live), through: true };
}
