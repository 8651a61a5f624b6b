import { Box3, Group, Matrix4, type Object3D, type Ray, Vector3 } from 'three';
import { prefersReducedMotion } from '../browser/reduced_motion.ts';
import { Download, readRawManifest } from '../model/bundle.ts';
import { manifestAt } from '../model/files.ts';
import { linksMovedBy, treeOf } from '../model/link_tree.ts';
import { readManifest } from '../model/manifest.ts';
import type { LinkLook, LinkTint } from '../model/posed_body.ts';
import type { ModelReport } from '../model/report.ts';
import { RootPose } from '../model/root_pose.ts';
import type { KinematicTree } from '../twin/kinematic_tree.ts';
import type { Pose } from '../twin/playback/pose.ts';
import type { LocalRobot } from '../urdf/local_robot.ts';
import type { PoseSource } from '../view/body_view.ts';
import { type GhostRequest, ghostOf } from '../view/ghost_pose.ts';
import type { Moving } from '../view/render_loop.ts';
import type { RowItem } from '../view/row_layout.ts';
import { BuiltRobot } from './robot/built_robot.ts';
import type { Figure, FigureGhost, Stage } from './robot/figure.ts';
import { Skeleton } from './robot/skeleton.ts';
import type { SkinTones } from './robot/skin.ts';
import { StaleEffect } from './robot/stale_effect.ts';
import { ShadowCaster } from './shadow.ts';
import type { SceneTheme } from './theme.ts';

/** What a robot asks of the scene that it stands in. */
export interface RobotNodeHost {
  readonly tones: SkinTones;
  theme(): SceneTheme;
  /** A mark for a mesh that can't be shown. */
  placeholder(): Object3D;
  /** It is somewhere else now, or looks different: shadows and a picture, please. */
  placed(): void;
  /** It has another size now: the camera should look again. */
  framed(robot: RobotNode, eased: boolean): void;
  /** A picture, please; nothing has moved. */
  changed(): void;
}

/** One robot in a scene: its model on the way in, its pose, and how old that is. */
export class RobotNode implements Moving, RowItem {
  /** Everything that is drawn of it. */
  readonly object = new Group();
  /** Where it stands among others: its own world lies here in the scene's, metres. */
  readonly #slot = new Group();
  readonly staleEffect: StaleEffect;
  readonly #place: RobotNodeHost;
  #figure: Figure | null = null;
  #built: BuiltRobot | null = null;
  #ghost: FigureGhost | null = null;
  #ghostWish: GhostRequest | null = null;
  #ghostLinks: readonly string[] = [];
  #skeleton: Skeleton | null = null;
  #caster: ShadowCaster | null = null;
  #loading: AbortController | null = null;
  #source: PoseSource | null = null;
  #pose: Pose | null = null;
  readonly #rootPose = new RootPose();
  #grey = false;
  #coarse = false;
  #unread: ReadonlySet<string> = NONE;

  constructor(place: RobotNodeHost) {
    this.#place = place;
    this.object.add(this.#slot);
    this.staleEffect = new StaleEffect(place.theme().stale);
    this.staleEffect.advance(Number.POSITIVE_INFINITY);
  }

  standAside(y: number): void {
    if (this.#slot.position.y === y) return;
    this.#slot.position.y = y;
    this.#slot.updateMatrixWorld(true);
    this.#put();
  }

  /** null until a model has come. */
  get figure(): Figure | null {
    return this.#figure;
  }

  /** Where it looks, rad from the world's x; 0 while there is no model. */
  get heading(): number {
    const elements = this.#figure?.root.matrixWorld.elements;
    return elements === undefined ? 0 : Math.atan2(elements[1]!, elements[0]!);
  }

  /** Shown in shells, no longer in lines. */
  get dressed(): boolean {
    return this.#figure !== null && this.#skeleton === null;
  }

  /** The pose that is shown. */
  get pose(): Pose | null {
    return this.#pose;
  }

  /** Loads the robot that a bundle's manifest describes. Never rejects: what is wrong stands in the report. A later
   *  call supersedes an earlier one. */
  load(
    manifestUrl: string,
    onProgress: (receivedBytes: number, totalBytes: number) => void,
  ): Promise<ModelReport> {
    return this.#supersede((signal, report) => this.#load(manifestUrl, onProgress, signal, report));
  }

  /** The same for a robot whose files this browser has already. */
  loadLocal(robot: LocalRobot): Promise<ModelReport> {
    return this.#supersede(async (signal, report) => {
      const { showRaw } = await import('./robot/raw_robot.ts');
      await showRaw(robot, this.#stage(signal), this.staleEffect, this.#place.tones, report, () => {});
      this.#place.framed(this, true);
    });
  }

  /** Lets it follow a source from the next tick on; the scene is woken when the source has something new. */
  play(source: PoseSource | null): void {
    this.#source = source;
    if (this.#figure !== null) source?.setContinuous(this.#figure.continuousNames);
  }

  /** Shows a pose at once; `live` false marks it as one that is not the robot's present. */
  setPose(pose: Pose, live: boolean): void {
    this.#show(pose);
    this.setGrey(!live);
  }

  /** Lets the colour drain to grey: stale or offline. A robot without any pose is grey. */
  setGrey(grey: boolean): void {
    this.#grey = grey;
    this.#updateGrey();
  }

  setTheme(theme: SceneTheme): void {
    this.staleEffect.setTone(theme.stale);
  }

  advance(seconds: number, nowMs: number): boolean {
    const moving = this.#source?.sample(nowMs) ?? false;
    const pose = this.#source?.pose() ?? null;
    if (pose !== null) this.#show(pose);
    if (this.staleEffect.settled) return moving;
    this.#place.changed();
    return this.staleEffect.advance(prefersReducedMotion() ? Number.POSITIVE_INFINITY : seconds) || moving;
  }

  /** Bytes that `refine` would fetch; null when there is nothing finer, or nothing that this device should carry. */
  get finerBytes(): number | null {
    return this.#built?.finestBytes ?? null;
  }

  /** Shows the finest level there is; the one before stays until then. Rejects with one line when it can't be had. */
  async refine(onProgress: (receivedBytes: number, totalBytes: number) => void): Promise<void> {
    await this.#built?.refine(onProgress);
  }

  /** Whether it is of a built model, which every view can show. */
  get built(): boolean {
    return this.#built !== null;
  }

  /** Whether it shows less than it could, for a slow device. */
  get coarse(): boolean {
    return this.#coarse && this.#built?.hasLevels === true;
  }

  /** Shows its coarsest level only: for a slow device. */
  keepCoarse(coarse: boolean): void {
    this.#coarse = coarse;
    void this.#built?.keepCoarse(coarse);
  }

  /** The link that a ray in the world meets first, or null. */
  pick(ray: Ray): string | null {
    return this.#figure?.pick(ray) ?? null;
  }

  /** How its links hang together; null until a model has come. */
  tree(): KinematicTree | null {
    return this.#figure === null ? null : treeOf(this.#figure);
  }

  setLinkLook(link: string, look: LinkLook): void {
    this.#figure?.setLook(link, look);
    this.#place.changed();
  }

  setTint(link: string, tint: LinkTint | null): void {
    this.#figure?.setTint(link, tint);
  }

  /**
   * Shows the robot a second time, see-through, in another pose (rad or m by URDF name); null takes it away. With
   * `limbs`, only what lies beyond those joints is shown, and all other joints stand as the body's do.
   */
  showGhost(joints: ReadonlyMap<string, number> | null, limbs: readonly string[] | null = null): void {
    if (joints === null && this.#ghostWish === null) return;
    this.#ghostWish = joints === null ? null : { joints, limbs };
    if (this.#poseGhost()) this.#place.changed();
  }

  /** Links of the ghost that are shown. */
  get ghostLinks(): readonly string[] {
    return this.#ghost === null ? [] : this.#ghostLinks;
  }

  /** world_from_link for every link: 4×4, row after row, metres, world Z up. */
  linkPoses(): Record<string, number[]> {
    const figure = this.#figure;
    if (figure === null) return {};
    return Object.fromEntries(
      figure.linkNames.map((name) => [name, ROWS.copy(figure.linkMatrix(name)!).transpose().toArray()]),
    );
  }

  get size(): [number, number, number] | null {
    return this.#figure === null ? null : this.bounds(BOX).getSize(SIZE).toArray();
  }

  /** The world's box around it; empty while there is no model. */
  bounds(into: Box3): Box3 {
    return this.#figure?.bounds(into) ?? into.makeEmpty();
  }

  dispose(): void {
    this.#loading?.abort();
    this.#clear();
    this.object.removeFromParent();
  }

  async #supersede(work: (signal: AbortSignal, report: ModelReport) => Promise<void>): Promise<ModelReport> {
    this.#loading?.abort();
    const loading = new AbortController();
    this.#loading = loading;
    const report: ModelReport = { missing: [], joints: [], ignored: [], problems: [] };
    try {
      await work(loading.signal, report);
    } catch (cause) {
      report.error = cause instanceof Error ? cause.message : String(cause);
      if (!loading.signal.aborted) this.#clear(); // the model before is not this robot's any more
    }
    if (loading.signal.aborted) report.error = 'superseded by a newer model';
    return report;
  }

  async #load(
    manifestUrl: string,
    onProgress: (receivedBytes: number, totalBytes: number) => void,
    signal: AbortSignal,
    report: ModelReport,
  ): Promise<void> {
    const raw = await manifestAt(manifestUrl);
    signal.throwIfAborted();
    const stage = this.#stage(signal);
    if (raw.v === 2) {
      const built = new BuiltRobot(
        readManifest(raw),
        manifestUrl,
        stage,
        this.staleEffect,
        this.#place.tones,
      );
      this.#built = built;
      void built.keepCoarse(this.#coarse);
      await built.dress(report, onProgress);
    } else {
      const { fetchUrdf, showRaw } = await import('./robot/raw_robot.ts');
      const manifest = readRawManifest(raw);
      // Until the URDF is read nobody knows which files it draws.
      let total = [...manifest.files.values()].reduce((sum, file) => sum + file.size, 0);
      const files = new Download(manifestUrl, signal, (received) => onProgress(received, total));
      const urdf = await fetchUrdf(manifest, files);
      signal.throwIfAborted();
      const model = { urdf, manifest, files };
      await showRaw(model, stage, this.staleEffect, this.#place.tones, report, (needed) => {
        total = needed;
      });
    }
    report.ignored = [...(this.#pose?.joints.keys() ?? [])].filter((name) => !report.joints.includes(name));
    this.#place.framed(this, true);
  }

  #stage(signal: AbortSignal): Stage {
    return {
      signal,
      show: (figure) => {
        signal.throwIfAborted();
        this.#adopt(figure);
      },
      skinned: () => {
        this.#skeleton?.dispose();
        this.#skeleton = null;
        this.#put();
      },
      changed: () => this.#put(),
      placeholder: () => this.#place.placeholder(),
    };
  }

  #adopt(figure: Figure): void {
    this.#clear();
    this.#figure = figure;
    this.#skeleton = new Skeleton(figure, this.#place.theme().muted);
    this.#caster = new ShadowCaster(figure.linkNames.length);
    this.#slot.add(figure.root);
    this.object.add(this.#skeleton.lines, this.#caster.blocks); // these follow the links in the scene's world
    this.#source?.setContinuous(figure.continuousNames);
    this.#unread = NONE;
    if (this.#pose !== null) {
      figure.setJoints(this.#pose.joints);
      this.#mark(this.#pose.unread ?? NONE);
    }
    this.#put();
    this.#place.framed(this, false);
  }

  #clear(): void {
    this.#caster?.dispose();
    this.#skeleton?.dispose();
    this.#figure?.dispose();
    this.#caster = this.#skeleton = this.#figure = this.#built = this.#ghost = null;
    this.#place.placed();
  }

  #show(pose: Pose): void {
    this.#pose = pose;
    this.#updateGrey();
    const stepped = this.#rootPose.update(pose);
    const turned = this.#figure?.setJoints(pose.joints) ?? false;
    const marked = this.#mark(pose.unread ?? NONE);
    if (turned || stepped) this.#put();
    else if (this.#poseGhost() || marked) this.#place.changed();
  }

  /** Marks the links whose joints have no reading; true when they are others than before. */
  #mark(joints: ReadonlySet<string>): boolean {
    if (joints === this.#unread || this.#figure === null) return false;
    this.#unread = joints;
    this.#figure.markUnread(linksMovedBy(this.#figure, joints));
    return true;
  }

  /** Whether the robot faces along the world's x whatever its sensors say. */
  lockHeading(locked: boolean): void {
    if (this.#rootPose.lockHeading(locked)) this.#put();
  }

  /** True when the ghost looks different now. */
  #poseGhost(): boolean {
    const figure = this.#figure;
    const wanted = figure === null ? null : ghostOf(figure, this.#pose, this.#ghostWish);
    if (figure === null || wanted === null) {
      const had = this.#ghost !== null;
      this.#ghost?.dispose();
      this.#ghost = null;
      return had;
    }
    const { joints, links } = wanted;
    const made = this.#ghost === null;
    const ghost = this.#ghost ?? figure.ghost();
    this.#ghost = ghost;
    const otherLinks = made || links.join('\n') !== this.#ghostLinks.join('\n');
    if (otherLinks) {
      this.#ghostLinks = links;
      const seen = new Set(links);
      for (const link of figure.linkNames) ghost.setLook(link, { hide: !seen.has(link) });
    }
    return ghost.setJoints(joints) || otherLinks;
  }

  /** Computes where every link is, and asks for a picture of it. */
  #put(): void {
    const figure = this.#figure;
    if (figure === null) return;
    const { xyz, quat_wxyz } = this.#rootPose.root((link) => figure.rootTurn(link));
    if (xyz === null) figure.ground(quat_wxyz);
    else figure.place(xyz, quat_wxyz);
    this.#poseGhost();
    this.#skeleton?.follow(figure);
    this.#caster?.follow(figure.boxes);
    this.#place.placed();
  }

  #updateGrey(): void {
    const grey = this.#grey || this.#pose === null;
    if (grey === this.staleEffect.grey) return;
    this.staleEffect.grey = grey;
    this.#place.changed();
  }
}

const NONE: ReadonlySet<string> = new Set();
const ROWS = new Matrix4();
const BOX = new Box3();
const SIZE = new Vector3();
