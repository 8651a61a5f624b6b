import type { LinkLook } from '../model/posed_body.ts';
import type { ModelReport } from '../model/report.ts';
import type { OverlayStyle, ShownOverlay } from '../overlays/robot_overlay.ts';
import type { KinematicTree } from '../twin/kinematic_tree.ts';
import type { OverlayReadings } from '../twin/overlay/reader.ts';
import type { Pose } from '../twin/playback/pose.ts';
import type { EyePlace, FollowMode } from './camera_rig.ts';
import type { ViewName } from './framing.ts';
import type { Insets } from './insets.ts';

export type { EyePlace, FollowMode } from './camera_rig.ts';

/** Where a robot's poses come from; asked in every tick while it says that there is more to come. */
export interface PoseSource {
  /** Moves on to this moment of the viewer's clock (ms since 1970). True while there is more to come. */
  sample(nowMs: number): boolean;
  /** As of the newest `sample`; null before the first one. */
  pose(): Pose | null;
  /** Which joints turn on and on, so that 3 and -3 rad are near each other. */
  setContinuous(joints: readonly string[]): void;
}

/** `orbit`: the left button turns and the right one pans; `foxglove`: the left one moves over the floor, the right one
 *  turns. */
export type MouseStyle = 'orbit' | 'foxglove';

/** What of a robot's signs is to be seen, for tests and curious people. */
export type SeenOverlay = ShownOverlay & {
  /** Links of the ghost that are shown. */
  readonly ghostLinks: readonly string[];
};

/** A body that shows more than its pose. */
export interface OverlaidBody {
  /** Forces, deviations, level and load of the newest frame; null while there is none. */
  showSigns(readings: OverlayReadings | null, manner?: OverlayStyle): void;
  /** Shows the robot a second time, see-through, in another pose (rad or m by URDF name); null takes it away. With
   *  `limbs`, only what lies beyond those joints, the others as the body has them. */
  showGhost(joints: ReadonlyMap<string, number> | null, limbs?: readonly string[] | null): void;
  /** Whether the robot faces along the world's x whatever its sensors say. */
  lockHeading(locked: boolean): void;
}

/** What the page asks of a body, whether it is drawn with WebGL (`RobotScene`) or by hand (`LightView`). Links and joints go
 *  by the URDF's names. */
export interface BodyView extends OverlaidBody {
  /** Pictures drawn so far. */
  readonly renderedFrames: number;
  /** Whether the newest picture stays as it is until something happens. */
  readonly resting: boolean;
  /** Draw calls of the newest picture. */
  readonly drawCalls: number;
  /** Triangles of the newest picture. */
  readonly triangles: number;
  readonly signs: SeenOverlay;
  /** Bytes that `refine` would fetch; null when there is nothing finer, or nothing that this device should carry. */
  readonly finerBytes: number | null;
  /** Never rejects: what is wrong stands in the report. A later call supersedes an earlier one. */
  load(
    manifestUrl: string,
    onProgress: (receivedBytes: number, totalBytes: number) => void,
  ): Promise<ModelReport>;
  refine(onProgress: (receivedBytes: number, totalBytes: number) => void): Promise<void>;
  /** Lets the robot follow a source of poses; `wake` when it has something new. */
  play(source: PoseSource | null): void;
  wake(): void;
  /** Shows a pose at once; `live` false marks it as one that is not the robot's present. */
  setPose(pose: Pose, live: boolean): void;
  /** Lets the colour drain to grey: stale or offline. */
  setGrey(grey: boolean): void;
  setTheme(name: 'dark' | 'light'): void;
  /** So much of the picture stands under notes and buttons: the robot stands between them. */
  setCover(cover: Insets): void;
  /** Where the eye is and what it looks at, metres, world. */
  readonly eye: EyePlace;
  /** The same from the floor under the middle of the robot, for another page to take; null while it is the first view. */
  readonly stand: EyePlace | null;
  /** Stands there at once, wherever the robot is. */
  standAt(place: EyePlace): void;
  look(view: ViewName): void;
  /** Comes close to a link; to one that is unknown it does not. */
  focus(link: string): void;
  /** Turns the eye around what it looks at, rad: to the left, and up. */
  orbit(left: number, up: number): void;
  /** The world goes along by so many CSS pixels. */
  pan(dx: number, dy: number): void;
  /** A factor below 1 comes nearer. */
  zoom(factor: number): void;
  setMouse(style: MouseStyle): void;
  setFollow(mode: FollowMode): void;
  /** The link under a point of the window (CSS pixels), or null. */
  pick(clientX: number, clientY: number): string | null;
  /** How the links hang together; null until a model has come. */
  tree(): KinematicTree | null;
  /** How a link is shown from now on; `{}` as at first. */
  setLinkLook(link: string, look: LinkLook): void;
  /** world_from_link of the pose that is shown, for every link: 4×4, row after row, metres, world Z up. */
  linkPoses(): Record<string, number[]>;
  dispose(): void;
}

/** One of several robots in a picture. */
export interface RowMember {
  load: BodyView['load'];
  play: BodyView['play'];
  setGrey: BodyView['setGrey'];
  showGhost: OverlaidBody['showGhost'];
  lockHeading: OverlaidBody['lockHeading'];
}

/** A body beside which others can stand; what `BodyView` says of the robot it says of the first. */
export interface RowView extends BodyView {
  /** All of them, the first at the right of the picture from the front. */
  readonly robots: readonly RowMember[];
  /** One more; it goes with the view. */
  addRobot(): RowMember;
  /** Where the top of one of them is in the picture, CSS px; null while it has no body or is behind the eye. */
  topOf(robot: RowMember): { x: number; y: number } | null;
  /** The same of one of them. */
  showSigns(readings: OverlayReadings | null, manner?: OverlayStyle, of?: RowMember): void;
  signsOf(robot: RowMember): SeenOverlay;
}
