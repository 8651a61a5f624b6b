import { isPassing } from '../../model/bundle.ts';
import type { ModelReport } from '../../model/report.ts';
import type { NodeHost } from '../figure/figure_node.ts';
import { FigureNode, type OnProgress } from '../figure/figure_node.ts';
import type { Box } from '../figure/robot_row.ts';
import type { LightColors } from './colors.ts';
import type { LightRobot } from './robot.ts';
import { loadRobot, loadShells } from './robot_loader.ts';

const DRAIN_SECONDS = 0.25;

/** What a robot needs from its light view. */
export interface LightRobotHost extends NodeHost {
  tones(): LightColors;
}

/** One robot in the light view, shown in its coarsest level. */
export class LightRobotNode extends FigureNode<LightRobot> {
  readonly #place: LightRobotHost;
  #aside = 0;
  #grey = 1;

  constructor(place: LightRobotHost) {
    super(place);
    this.#place = place;
  }

  /** How far it has faded to grey, 0…1. */
  get grey(): number {
    return this.#grey;
  }

  box(): Box | null {
    return this.figure?.bounds() ?? null;
  }

  standAside(y: number): void {
    if (y === this.#aside) return;
    this.#aside = y;
    if (this.figure === null) return;
    this.figure.aside = y;
    this.put();
  }

  setTones(tones: LightColors): void {
    this.figure?.setTones(tones);
  }

  protected override async read(
    manifestUrl: string,
    onProgress: OnProgress,
    signal: AbortSignal,
    report: ModelReport,
  ): Promise<void> {
    const robot = await loadRobot(manifestUrl, this.#place.tones());
    signal.throwIfAborted();
    robot.setTones(this.#place.tones()); // the theme may have changed meanwhile
    this.adopt(robot);
    const { findings, missing } = robot.manifest;
    report.joints = [...robot.jointNames];
    report.findings = findings;
    report.missing = missing.map(({ uri }) => uri);
    report.problems.push(...missing.map(({ uri, reason }) => `${uri}: ${reason}`));
    try {
      await loadShells(robot, manifestUrl, signal, onProgress);
    } catch (cause) {
      signal.throwIfAborted();
      report.bare = cause instanceof Error ? cause.message : String(cause);
      if (isPassing(cause)) report.passing = true;
      report.problems.push(report.bare);
    }
  }

  protected override adopted(figure: LightRobot): void {
    figure.aside = this.#aside;
  }

  protected override drain(seconds: number): boolean {
    const left = (this.isOld ? 1 : 0) - this.#grey;
    if (left === 0) return false;
    const step = seconds / DRAIN_SECONDS;
    const there = Math.abs(left) <= step;
    this.#grey = there ? this.#grey + left : this.#grey + Math.sign(left) * step;
    this.#place.changed();
    return !there;
  }
}
