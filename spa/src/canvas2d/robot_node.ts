import { prefersReducedMotion } from '../browser/reduced_motion.ts';
import { treeOf } from '../model/link_tree.ts';
import type { LinkLook } from '../model/posed_body.ts';
import type { ModelReport } from '../model/report.ts';
import type { KinematicTree } from '../twin/kinematic_tree.ts';
import type { Pose } from '../twin/playback/pose.ts';
import type { PoseSource, RowMember } from '../view/body_view.ts';
import type { GhostRequest } from '../view/ghost_pose.ts';
import type { Moving } from '../view/render_loop.ts';
import type { RowItem } from '../view/row_layout.ts';
import type { LightColors } from './colors.ts';
import type { LightRobot } from './robot.ts';
import { dress, loadRobot } from './robot_loader.ts';

const DRAIN_SECONDS = 0.25;

type OnProgress = (receivedBytes: number, totalBytes: number) => void;

/** What a robot asks of the picture that it stands in. */
export interface LightRobotHost {
  tones(): LightColors;
  /** It is somewhere else now. */
  placed(): void;
  /** It has another size now: the eye should look again. */
  framed(eased: boolean): void;
  /** A picture, please; nothing has moved. */
  changed(): void;
}

/** One robot in a picture drawn by hand: its model on the way in, its pose, and how old that is. */
export class LightRobotNode implements RowMember, Moving, RowItem {
  readonly #place: LightRobotHost;
  #figure: LightRobot | null = null;
  #source: PoseSource | null = null;
  #pose: Pose | null = null;
  #ghostWish: GhostRequest | null = null;
  #headingLocked = false;
  #loading: AbortController | null = null;
  #aside = 0;
  #greyAsked = true;
  #grey = 1;

  constructor(place: LightRobotHost) {
    this.#place = place;
  }

  /** null until a model has come. */
  get figure(): LightRobot | null {
    return this.#figure;
  }

  /** How far its colours have drained, 0…1. */
  get grey(): number {
    return this.#grey;
  }

  get size(): [number, number, number] | null {
    if (this.#figure === null) return null;
    const { min, max } = this.#figure.bounds();
    return [max[0] - min[0], max[1] - min[1], max[2] - min[2]];
  }

  standAside(y: number): void {
    this.#aside = y;
    if (this.#figure?.standAside(y) === true) this.#place.placed();
  }

  async load(manifestUrl: string, onProgress: OnProgress): Promise<ModelReport> {
    this.#loading?.abort();
    const loading = new AbortController();
    this.#loading = loading;
    const report: ModelReport = { missing: [], joints: [], ignored: [], problems: [] };
    try {
      await this.#load(manifestUrl, onProgress, loading.signal, report);
    } catch (cause) {
      report.error = cause instanceof Error ? cause.message : String(cause);
      if (!loading.signal.aborted) this.#adopt(null);
    }
    if (loading.signal.aborted) report.error = 'superseded by a newer model';
    return report;
  }

  play(source: PoseSource | null): void {
    this.#source = source;
    if (this.#figure !== null) source?.setContinuous(this.#figure.continuousNames);
  }

  setPose(pose: Pose, live: boolean): void {
    this.#show(pose);
    this.setGrey(!live);
  }

  setGrey(grey: boolean): void {
    if (grey === this.#greyAsked) return;
    this.#greyAsked = grey;
    this.#place.changed();
  }

  setTones(tones: LightColors): void {
    this.#figure?.setTones(tones);
  }

  showGhost(joints: ReadonlyMap<string, number> | null, limbs: readonly string[] | null = null): void {
    this.#ghostWish = joints === null ? null : { joints, limbs };
    if (this.#figure?.showGhost(this.#ghostWish) === true) this.#place.changed();
  }

  lockHeading(locked: boolean): void {
    this.#headingLocked = locked;
    if (this.#figure?.lockHeading(locked) === true) this.#place.placed();
  }

  setLinkLook(link: string, look: LinkLook): void {
    if (this.#figure?.setLook(link, look) === true) this.#place.changed();
  }

  tree(): KinematicTree | null {
    return this.#figure === null ? null : treeOf(this.#figure);
  }

  advance(seconds: number, nowMs: number): boolean {
    const playing = this.#source?.sample(nowMs) ?? false;
    const pose = this.#source?.pose() ?? null;
    if (pose !== null) this.#show(pose);
    const goal = this.#greyAsked || this.#pose === null ? 1 : 0;
    if (this.#grey !== goal) {
      const step = prefersReducedMotion() ? 1 : seconds / DRAIN_SECONDS;
      const left = goal - this.#grey;
      this.#grey = Math.abs(left) <= step ? goal : this.#grey + Math.sign(left) * step;
      this.#place.changed();
    }
    return playing || this.#grey !== goal;
  }

  dispose(): void {
    this.#loading?.abort();
  }

  async #load(
    manifestUrl: string,
    onProgress: OnProgress,
    signal: AbortSignal,
    report: ModelReport,
  ): Promise<void> {
    const robot = await loadRobot(manifestUrl, this.#place.tones());
    signal.throwIfAborted();
    robot.setTones(this.#place.tones()); // another theme may have been chosen meanwhile
    this.#adopt(robot);
    this.#place.framed(false);
    const { findings, missing } = robot.manifest;
    report.joints = robot.jointNames;
    report.ignored = [...(this.#pose?.joints.keys() ?? [])].filter((name) => !report.joints.includes(name));
    report.findings = findings;
    report.missing = missing.map(({ uri }) => uri);
    report.problems.push(...missing.map(({ uri, reason }) => `${uri}: ${reason}`));
    try {
      await dress(robot, manifestUrl, signal, onProgress);
    } catch (cause) {
      signal.throwIfAborted();
      report.bare = cause instanceof Error ? cause.message : String(cause);
      report.problems.push(report.bare);
    }
    this.#place.framed(true);
  }

  #adopt(robot: LightRobot | null): void {
    this.#figure = robot;
    if (robot !== null) {
      this.#source?.setContinuous(robot.continuousNames);
      robot.lockHeading(this.#headingLocked);
      robot.showGhost(this.#ghostWish);
      robot.standAside(this.#aside);
      if (this.#pose !== null) robot.setPose(this.#pose);
    }
    this.#place.placed();
  }

  #show(pose: Pose): void {
    this.#pose = pose;
    if (this.#figure?.setPose(pose) === true) this.#place.placed();
  }
}
