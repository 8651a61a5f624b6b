import type { LinkLook } from '../../model/posed_body.ts';
import type { ModelReport } from '../../model/report.ts';
import type { KinematicTree } from '../../twin/kinematic_tree.ts';
import type { JointValues, Pose } from '../../twin/playback/pose.ts';
import type { EyePlace, FollowMode } from '../camera/camera_rig.ts';
import type { ViewName } from '../camera/framing.ts';
import type { Insets } from '../camera/insets.ts';
import type { RobotSigns } from '../signs/signs.ts';

export type { EyePlace, FollowMode } from '../camera/camera_rig.ts';

/** The source of a robot's poses. It is queried at every tick as long as it has more. */
export interface PoseSource {
  /** Advances to `nowMs` of the viewer's clock (ms since 1970). True while more motion follows. */
  sample(nowMs: number): boolean;
  /** The pose at the newest `sample`; null before the first. */
  pose(): Pose | null;
  /** Names the continuous joints, whose angles wrap: 3 and -3 rad are near each other. */
  setContinuous(joints: readonly string[]): void;
}

/** What a robot's signs have drawn, by key, for tests and the debug interface. */
export type DrawnSigns = Readonly<Record<string, unknown>> & {
  /** The visible links of the ghost. */
  readonly ghostLinks: readonly string[];
};

/** Which fingers on the picture move the camera. */
export type Fingers = 'all' | 'two';

/** The view of a robot's body that the page uses, drawn with WebGL (`RobotScene`) or on a 2D canvas (`LightView`).
 *  Links and joints go by their URDF names. */
export interface BodyView {
  /** Shows a robot's signs. Call it whenever they have read a frame. */
  showSigns(signs: RobotSigns): void;
  /** Shows a transparent second copy of the robot in another pose; null removes it. With `limbs`, shows only the links beyond
   *  those joints, and joints without a value are as in the body. The same links should be the same array. */
  showGhost(joints: JointValues | null, limbs?: readonly string[] | null): void;
  /** Sets whether the robot always faces along the world's x axis, whatever its sensors report. */
  lockHeading(locked: boolean): void;
  /** Pictures drawn so far. */
  readonly renderedFrames: number;
  /** Whether nothing is being drawn: the newest picture stays until something changes. */
  readonly resting: boolean;
  /** Draw calls of the newest picture. */
  readonly drawCalls: number;
  /** Triangles of the newest picture. */
  readonly triangles: number;
  readonly signs: DrawnSigns;
  /** Bytes that `refine` would fetch; null if there is nothing finer, or only levels too large for this device. */
  readonly finerBytes: number | null;
  /** Loads the model of a manifest. Never rejects: errors are in the report. A later call supersedes an earlier one. */
  load(
    manifestUrl: string,
    onProgress: (receivedBytes: number, totalBytes: number) => void,
  ): Promise<ModelReport>;
  /** Shows the finest level of detail. Rejects with one line if it can't be loaded. */
  refine(onProgress: (receivedBytes: number, totalBytes: number) => void): Promise<void>;
  /** Lets the robot follow a source of poses. Call `wake` when the source has something new. */
  play(source: PoseSource | null): void;
  wake(): void;
  /** Shows a pose at once; `live` false shows it in grey as out of date. */
  setPose(pose: Pose, live: boolean): void;
  /** Fades the colours to grey for a robot that is stale or offline, or back. */
  setGrey(grey: boolean): void;
  setTheme(name: 'dark' | 'light'): void;
  /** Sets how much of the picture is covered by notes and buttons; the robot is centred in the rest. */
  setCover(cover: Insets): void;
  /** Position and target of the camera in the world, metres. */
  readonly eye: EyePlace;
  /** The same relative to the floor under the robot's middle, for sharing; null until the viewer moves the camera. */
  readonly stand: EyePlace | null;
  /** Puts the camera at a place as in `stand`, relative to this robot wherever it is. */
  standAt(place: EyePlace): void;
  look(view: ViewName): void;
  /** Moves the camera close to a link; an unknown link is ignored. */
  focus(link: string): void;
  /** Moves the camera close to a link's joint, and if possible around it so that the body does not hide it. An unknown link is
   *  ignored. */
  visit(link: string): void;
  /** Moves the camera back to where it was before `visit`, unless the viewer has moved it since. */
  goBack(): void;
  /** Turns the camera around its target, rad: to the left, and up. */
  orbit(left: number, up: number): void;
  /** Moves the camera so that the world shifts by this many CSS pixels. */
  pan(dx: number, dy: number): void;
  /** Scales the distance to the target; a factor below 1 moves closer. */
  zoom(factor: number): void;
  setFollow(mode: FollowMode): void;
  /** Gives back what the browser has few of, a WebGL context, while nobody sees the view, or takes it again. Meanwhile the newest
   *  picture stays. */
  setAsleep(asleep: boolean): void;
  /** Sets what fingers do: with `all`, one turns the camera, two move it; with `two`, one is left to the page, which scrolls, and two
   *  turn the camera. */
  setFingers(fingers: Fingers): void;
  /** Whether it draws the signs of balance. */
  readonly drawsBalance: boolean;
  /** The link under a point of the window (CSS pixels), or null. */
  pick(clientX: number, clientY: number): string | null;
  /** The kinematic tree of the model; null until it is loaded. */
  tree(): KinematicTree | null;
  /** Sets how a link is shown; `{}` resets it. */
  setLinkLook(link: string, look: LinkLook): void;
  /** world_from_link of the displayed pose for every link: 4×4, row-major, metres, world Z up. */
  linkPoses(): Record<string, number[]>;
  dispose(): void;
}

/** One of several robots in a view. */
export interface RowMember {
  load: BodyView['load'];
  play: BodyView['play'];
  setGrey: BodyView['setGrey'];
  lockHeading: BodyView['lockHeading'];
}

/** A view with several robots side by side. The members of `BodyView` apply to the first of them. */
export interface RowView extends BodyView {
  /** All robots; seen from the front, the first is on the right of the picture. */
  readonly robots: readonly RowMember[];
  /** Adds a robot, which is disposed of with the view. */
  addRobot(): RowMember;
  /** Where the top of a robot appears in the picture, CSS px; null while it has no body or is behind the camera. */
  topOf(robot: RowMember): { x: number; y: number } | null;
  /** `showSigns` for any of the robots. */
  showSigns(signs: RobotSigns, of?: RowMember): void;
  signsOf(robot: RowMember): DrawnSigns;
}
