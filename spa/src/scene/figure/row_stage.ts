import { type LinkLook, treeOf } from '../../model/posed_body.ts';
import type { ModelReport } from '../../model/report.ts';
import { originOf } from '../../model/vectors.ts';
import type { KinematicTree } from '../../twin/kinematic_tree.ts';
import type { JointValues, Pose } from '../../twin/playback/pose.ts';
import type { CameraRig, EyePlace, FollowMode } from '../camera/camera_rig.ts';
import type { ViewName } from '../camera/framing.ts';
import type { Insets } from '../camera/insets.ts';
import type { RobotSigns } from '../signs/signs.ts';
import type { DrawnSigns, Fingers, PoseSource, RowView } from './body_view.ts';
import type { FigureNode, NodeHost, OnProgress, StagedFigure } from './figure_node.ts';
import { RenderLoop } from './render_loop.ts';
import type { RobotRow } from './robot_row.ts';

/** The renderer-independent part of a view: one or several robots, a camera rig that keeps them in the picture, and a
 *  loop that draws them. Members about "the robot" mean the first. */
export abstract class RowStage<N extends FigureNode<StagedFigure>> implements RowView {
  protected readonly loop = new RenderLoop(() => this.draw());
  protected abstract readonly row: RobotRow<N>;
  protected abstract readonly rig: CameraRig;

  abstract readonly resting: boolean;
  abstract readonly drawCalls: number;
  abstract readonly drawsBalance: boolean;
  abstract readonly triangles: number;
  abstract readonly finerBytes: number | null;
  abstract refine(onProgress: OnProgress): Promise<void>;
  abstract setTheme(name: 'dark' | 'light'): void;
  abstract setFingers(fingers: Fingers): void;
  abstract pick(clientX: number, clientY: number): string | null;
  abstract signsOf(robot: N): DrawnSigns;
  abstract topOf(robot: N): { x: number; y: number } | null;
  abstract dispose(): void;

  get renderedFrames(): number {
    return this.loop.renderedFrames;
  }

  get robots(): readonly N[] {
    return this.row.robots;
  }

  addRobot(): N {
    const robot = this.make({
      placed: () => this.#placed(),
      framed: (eased) => this.#framed(eased),
      changed: () => this.loop.request(),
    });
    this.row.add(robot);
    if (this.row.several) this.rig.home = 'front'; // from other directions they would hide each other
    this.loop.add(robot);
    return robot;
  }

  load(manifestUrl: string, onProgress: OnProgress): Promise<ModelReport> {
    return this.robot.load(manifestUrl, onProgress);
  }

  play(source: PoseSource | null): void {
    this.robot.play(source);
    this.loop.wake();
  }

  wake(): void {
    this.loop.wake();
  }

  setPose(pose: Pose, live: boolean): void {
    this.robot.setPose(pose, live);
  }

  setGrey(grey: boolean): void {
    this.robot.setGrey(grey);
  }

  setCover(cover: Insets): void {
    this.rig.cover(cover);
  }

  /** By default there is nothing to give back. */
  setAsleep(_asleep: boolean): void {}

  get eye(): EyePlace {
    return this.rig.eye;
  }

  get stand(): EyePlace | null {
    return this.rig.stand;
  }

  standAt(place: EyePlace): void {
    this.rig.standAt(place);
  }

  look(view: ViewName): void {
    this.rig.look(view);
  }

  focus(link: string): void {
    const at = this.robot.figure?.linkMatrix(link);
    if (at !== undefined) this.rig.focus(originOf(at.elements));
  }

  visit(link: string): void {
    const { figure } = this.robot;
    const at = figure?.linkMatrix(link);
    if (figure === null || at === undefined) return;
    const tree = treeOf(figure);
    const joint = tree.jointOf(link);
    const own = new Set((joint === null ? [link] : tree.bodyOf(joint)).map((name) => figure.linkBox(name)));
    const hiding = this.row.robots.flatMap((robot) => [...(robot.figure?.boxes ?? [])]);
    this.rig.visit(
      originOf(at.elements),
      hiding.filter(([, box]) => !own.has(box)),
    );
  }

  goBack(): void {
    this.rig.goBack();
  }

  orbit(left: number, up: number): void {
    this.rig.orbit(left, up);
  }

  pan(dx: number, dy: number): void {
    this.rig.pan(dx, dy);
  }

  zoom(factor: number): void {
    this.rig.zoom(factor);
  }

  setFollow(mode: FollowMode): void {
    this.rig.followMode = mode;
  }

  tree(): KinematicTree | null {
    return this.robot.tree();
  }

  setLinkLook(link: string, look: LinkLook): void {
    this.robot.setLinkLook(link, look);
  }

  showGhost(joints: JointValues | null, limbs: readonly string[] | null = null): void {
    this.robot.showGhost(joints, limbs);
  }

  showSigns(signs: RobotSigns, of: N = this.robot): void {
    const { joints = null, limbs = null } = signs.ghost ?? {};
    of.showGhost(joints, limbs);
  }

  get signs(): DrawnSigns {
    return this.signsOf(this.robot);
  }

  lockHeading(locked: boolean): void {
    this.robot.lockHeading(locked);
  }

  linkPoses(): Record<string, number[]> {
    return this.robot.linkPoses();
  }

  /** The first robot, which is the main one. */
  protected get robot(): N {
    return this.row.robots[0]!;
  }

  /** Draws a picture; false if it could not. */
  protected abstract draw(): boolean;

  protected abstract make(host: NodeHost): N;

  /** Called when robots have moved or changed shape; `middle` is their position, null without a model. */
  protected abstract placed(middle: { readonly x: number; readonly y: number } | null): void;

  /** Called when the camera has reframed the robots. */
  protected abstract framed(): void;

  #placed(): void {
    const middle = this.row.middle();
    if (middle !== null) this.rig.follow(middle.x, middle.y, this.row.heading, this.row.span());
    this.placed(middle);
  }

  #framed(eased: boolean): void {
    const box = this.row.arrange();
    if (box === null) return;
    this.rig.frame(box.min, box.max, eased);
    this.framed();
  }
}
