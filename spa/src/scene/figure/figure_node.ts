import { prefersReducedMotion } from '../../browser/painting.ts';
import { type ArticulatedBody, RootPose } from '../../model/articulated_body.ts';
import { isPassing } from '../../model/bundle.ts';
import { type LinkLook, linksBeyond, linksMovedBy, type PosedBody, treeOf } from '../../model/posed_body.ts';
import type { ModelReport } from '../../model/report.ts';
import type { KinematicTree } from '../../twin/kinematic_tree.ts';
import { type JointValues, NO_JOINTS, type Pose } from '../../twin/playback/pose.ts';
import type { Quat, Vec3 } from '../../twin/rotation.ts';
import type { PoseSource, RowMember } from './body_view.ts';
import type { Moving } from './render_loop.ts';
import type { Box, RowNode } from './robot_row.ts';

export type OnProgress = (receivedBytes: number, totalBytes: number) => void;

/** A transparent copy of a robot in another pose. It lives no longer than its robot. */
export interface FigureGhost {
  /** Sets its joints; readings in `instead` win. False if nothing changed. */
  setJoints(joints: JointValues, instead?: JointValues | null): boolean;
  /** Sets how a link is shown; a ghost can only fade and hide. */
  setLook(link: string, look: LinkLook): void;
  dispose(): void;
}

/** A robot's body as a `FigureNode` poses and places it, independent of the renderer. */
export interface StagedFigure extends PosedBody {
  /** The names of its continuous joints, whose angles wrap. */
  readonly continuousNames: readonly string[];
  /** Sets the joints. False if nothing changed. */
  setJoints(joints: JointValues): boolean;
  /** Places the root link in the world (metres, unit quaternion) and computes the poses of all links. */
  place(xyz: Vec3, quat_wxyz: Quat): void;
  /** Puts the root over the world's origin with this rotation (default upright), the lowest point on the floor. */
  ground(quat_wxyz?: Quat): void;
  /** Sets how a link is shown. */
  setLook(link: string, look: LinkLook): void;
  ghost(): FigureGhost;
  dispose(): void;
}

/** How a robot notifies its view. */
export interface NodeHost {
  /** It has moved or changed shape: shadows and picture must be redrawn. */
  placed(): void;
  /** Its size has changed: the camera should reframe it. */
  framed(eased: boolean): void;
  /** It looks different but has not moved: the picture must be redrawn. */
  changed(): void;
}

/** How long it fades from colour to grey, s. */
const FADE_SECONDS = 0.25;
/** Fading ends after this time, however few pictures there are. */
const FADED_AFTER_MS = 300;

/** One robot in a view: loads its model, and keeps its pose, its ghost and whether its pose is old. */
export abstract class FigureNode<F extends StagedFigure> implements RowMember, Moving, RowNode {
  readonly #host: NodeHost;
  readonly #rootPose = new RootPose();
  #figure: F | null = null;
  #ghost: FigureGhost | null = null;
  #ghostRequest: GhostRequest | null = null;
  #ghostLimbs: readonly string[] | null = null;
  #ghostLinks: readonly string[] = [];
  #loading: AbortController | null = null;
  #source: PoseSource | null = null;
  #pose: Pose | null = null;
  #grey = false;
  #isOld = true;
  #faded = 1;
  /** When `#isOld` last changed, in the browser's frame time, ms. */
  #turnedMs = Number.NEGATIVE_INFINITY;
  /** Its body has not been shown in a pose yet. */
  #unseen = true;
  #unread: ReadonlySet<string> = NONE;

  constructor(host: NodeHost) {
    this.#host = host;
  }

  /** The body; null until a model is loaded. */
  get figure(): F | null {
    return this.#figure;
  }

  /** The displayed pose. */
  get pose(): Pose | null {
    return this.#pose;
  }

  /** Whether it is shown in grey: its pose is out of date, or there is none. */
  get isOld(): boolean {
    return this.#isOld;
  }

  /** How far it has faded to grey, 0…1. */
  get grey(): number {
    return this.#faded;
  }

  /** Its heading, rad from the world's x axis; 0 while there is no model. */
  get heading(): number {
    const elements = this.#figure?.root.matrixWorld.elements;
    return elements === undefined ? 0 : Math.atan2(elements[1]!, elements[0]!);
  }

  get size(): [number, number, number] | null {
    const box = this.box();
    if (box === null) return null;
    const { min, max } = box;
    return [max[0] - min[0], max[1] - min[1], max[2] - min[2]];
  }

  abstract box(): Box | null;

  abstract standAside(y: number): void;

  /** Loads the robot of a bundle's manifest. Never rejects: errors are in the report. A later call supersedes an
   *  earlier one. */
  load(manifestUrl: string, onProgress: OnProgress): Promise<ModelReport> {
    return this.supersede(async (signal, report) => {
      await this.read(manifestUrl, onProgress, signal, report);
      const { names, values } = this.#pose?.joints ?? NO_JOINTS;
      report.ignored = names.filter((name, i) => !Number.isNaN(values[i]) && !report.joints.includes(name));
      this.#host.framed(true);
    });
  }

  /** Lets it follow a source from the next tick on. The caller wakes the loop when the source has something new. */
  play(source: PoseSource | null): void {
    this.#source = source;
    if (this.#figure !== null) source?.setContinuous(this.#figure.continuousNames);
  }

  /** Shows a pose at once; `live` false shows it in grey as out of date. */
  setPose(pose: Pose, live: boolean): void {
    this.#show(pose);
    this.setGrey(!live);
  }

  /** Fades the colours to grey for a robot that is stale or offline, or back. A robot without any pose is always grey.
   *  */
  setGrey(grey: boolean): void {
    this.#grey = grey;
    this.#updateGrey();
  }

  advance(seconds: number, nowMs: number): boolean {
    const moving = this.#source?.sample(nowMs) ?? false;
    const pose = this.#source?.pose() ?? null;
    if (pose !== null) this.#show(pose);
    // It never looks old for longer than the fading takes: not in its first picture, nor if pictures are rare.
    const atOnce = this.#unseen || nowMs - this.#turnedMs > FADED_AFTER_MS || prefersReducedMotion();
    if (this.#figure !== null && this.#pose !== null) this.#unseen = false;
    return this.#fade(atOnce ? Number.POSITIVE_INFINITY : seconds) || moving;
  }

  /** The kinematic tree of its model; null until it is loaded. */
  tree(): KinematicTree | null {
    return this.#figure === null ? null : treeOf(this.#figure);
  }

  setLinkLook(link: string, look: LinkLook): void {
    this.#figure?.setLook(link, look);
    this.#host.changed();
  }

  /**
   * Shows a transparent second copy of the robot in another pose; null removes it. With `limbs`, only the links beyond those joints
   * are shown, and all joints without a value are as in the body.
   */
  showGhost(joints: JointValues | null, limbs: readonly string[] | null = null): void {
    if (joints === null && this.#ghostRequest === null) return;
    this.#ghostRequest = joints === null ? null : { joints, limbs };
    if (this.#poseGhost()) this.#host.changed();
  }

  /** The visible links of the ghost. */
  get ghostLinks(): readonly string[] {
    return this.#ghost === null ? [] : this.#ghostLinks;
  }

  /** Sets whether the robot always faces along the world's x axis, whatever its sensors report. */
  lockHeading(locked: boolean): void {
    if (this.#rootPose.lockHeading(locked)) this.put();
  }

  /** world_from_link for every link: 4×4, row-major, metres, world Z up. */
  linkPoses(): Record<string, number[]> {
    const figure = this.#figure;
    if (figure === null) return {};
    return Object.fromEntries(
      figure.linkNames.map((name) => {
        const { elements } = figure.linkMatrix(name)!;
        return [name, Array.from({ length: 16 }, (_, i) => elements[(i % 4) * 4 + Math.floor(i / 4)]!)];
      }),
    );
  }

  dispose(): void {
    this.#loading?.abort();
    this.clear();
  }

  /** Reads a model and shows it with `adopt`. Rejects with a one-line Error if there is nothing to show. */
  protected abstract read(
    manifestUrl: string,
    onProgress: OnProgress,
    signal: AbortSignal,
    report: ModelReport,
  ): Promise<void>;

  /** Called with a new figure before it is posed and placed. */
  protected adopted(_figure: F): void {}

  /** Called when the figure's links have moved. */
  protected moved(_figure: F): void {}

  /** Called when `grey` has changed. */
  protected faded(_grey: number): void {}

  /** Runs a loading task and cancels the previous one. Its errors go into the report. */
  protected async supersede(
    work: (signal: AbortSignal, report: ModelReport) => Promise<void>,
  ): Promise<ModelReport> {
    this.#loading?.abort();
    const loading = new AbortController();
    this.#loading = loading;
    const report: ModelReport = { missing: [], joints: [], ignored: [], problems: [] };
    try {
      await work(loading.signal, report);
    } catch (cause) {
      report.error = cause instanceof Error ? cause.message : String(cause);
      if (isPassing(cause)) report.passing = true;
      if (!loading.signal.aborted) this.clear(); // the previous model is no longer this robot's
    }
    if (loading.signal.aborted) report.error = 'superseded by a newer model';
    return report;
  }

  /** Replaces the figure with this one, in the newest pose. */
  protected adopt(figure: F): void {
    this.clear();
    this.#figure = figure;
    this.#unseen = true;
    this.adopted(figure);
    this.#source?.setContinuous(figure.continuousNames);
    this.#unread = NONE;
    if (this.#pose !== null) {
      figure.setJoints(this.#pose.joints);
      this.#mark(this.#pose.unread ?? NONE);
    }
    this.put();
    this.#host.framed(false);
  }

  /** Removes the figure and disposes of it. */
  protected clear(): void {
    this.#figure?.dispose();
    this.#figure = this.#ghost = null;
    this.#host.placed();
  }

  /** Places root and ghost by the newest pose, computes the poses of all links, and requests a picture. */
  protected put(): void {
    const figure = this.#figure;
    if (figure === null) return;
    const { xyz, quat_wxyz } = this.#rootPose.root((link) => figure.rootTurn(link));
    if (xyz === null) figure.ground(quat_wxyz);
    else figure.place(xyz, quat_wxyz);
    this.#poseGhost();
    this.moved(figure);
    this.#host.placed();
  }

  /** Advances the fading by `seconds` (Infinity: to its end). True while it continues. */
  #fade(seconds: number): boolean {
    const goal = this.#isOld ? 1 : 0;
    const left = goal - this.#faded;
    if (left === 0) return false;
    const step = seconds / FADE_SECONDS;
    this.#faded = Math.abs(left) <= step ? goal : this.#faded + Math.sign(left) * step;
    this.faded(this.#faded);
    this.#host.changed();
    return this.#faded !== goal;
  }

  #show(pose: Pose): void {
    this.#pose = pose;
    this.#updateGrey();
    const stepped = this.#rootPose.update(pose);
    const turned = this.#figure?.setJoints(pose.joints) ?? false;
    const marked = this.#mark(pose.unread ?? NONE);
    if (turned || stepped) this.put();
    else if (this.#poseGhost() || marked) this.#host.changed();
  }

  /** Marks the links whose joints have no reading; true if that changed. */
  #mark(joints: ReadonlySet<string>): boolean {
    if (this.#figure === null || sameSet(joints, this.#unread)) return false;
    this.#unread = joints;
    this.#figure.markUnread(linksMovedBy(this.#figure, joints));
    return true;
  }

  /** Creates, poses or removes the ghost. True if it looks different now. */
  #poseGhost(): boolean {
    const figure = this.#figure;
    const whole = this.#pose?.ghost ?? null;
    const request = whole === null ? this.#ghostRequest : { joints: whole, limbs: null };
    if (figure === null || request === null) {
      const had = this.#ghost !== null;
      this.#ghost?.dispose();
      this.#ghost = null;
      return had;
    }
    const { joints, limbs } = request;
    const isOther = this.#ghost === null || limbs !== this.#ghostLimbs;
    const ghost = this.#ghost ?? figure.ghost();
    this.#ghost = ghost;
    if (isOther) {
      this.#ghostLimbs = limbs;
      this.#ghostLinks = limbs === null ? figure.linkNames : linksBeyond(figure, limbs);
      const shown = new Set(this.#ghostLinks);
      for (const link of figure.linkNames) ghost.setLook(link, { hide: !shown.has(link) });
    }
    const isMoved =
      limbs === null ? ghost.setJoints(joints) : ghost.setJoints(this.#pose?.joints ?? NO_JOINTS, joints);
    return isMoved || isOther;
  }

  #updateGrey(): void {
    const isOld = this.#grey || this.#pose === null;
    if (isOld === this.#isOld) return;
    this.#isOld = isOld;
    this.#turnedMs = performance.now();
    this.#host.changed();
  }
}

const NONE: ReadonlySet<string> = new Set();

function sameSet<T>(a: ReadonlySet<T>, b: ReadonlySet<T>): boolean {
  return a === b || (a.size === b.size && [...a].every((item) => b.has(item)));
}

/** A request for a ghost, as in `showGhost`. */
interface GhostRequest {
  readonly joints: JointValues;
  readonly limbs: readonly string[] | null;
}

/** Reports what the manifest of a built model says about it. */
export function reportModel(report: ModelReport, { manifest, jointNames }: ArticulatedBody): void {
  const { findings, missing } = manifest;
  report.joints = [...jointNames];
  report.findings = findings;
  report.missing = missing.map(({ uri }) => uri);
  report.problems.push(...missing.map(({ uri, reason }) => `${uri}: ${reason}`));
}

/** Reports why a robot is shown without meshes. */
export function reportBare(report: ModelReport, cause: unknown): void {
  report.bare = cause instanceof Error ? cause.message : String(cause);
  if (isPassing(cause)) report.passing = true;
  report.problems.push(report.bare);
}
