import { manifestAt } from '../../model/files.ts';
import { fetchLevel } from '../../model/lod.ts';
import { type Manifest, readManifest } from '../../model/manifest.ts';
import type { ModelReport } from '../../model/report.ts';
import {
  FigureNode,
  type NodeHost,
  type OnProgress,
  reportBare,
  reportModel,
} from '../figure/figure_node.ts';
import type { Box } from '../figure/robot_row.ts';
import { type LightColors, linear } from './colors.ts';
import { LightRobot } from './robot.ts';

/** What a robot needs from its light view. */
export interface LightRobotHost extends NodeHost {
  tones(): LightColors;
}

/** One robot in the light view, shown in its coarsest level. */
export class LightRobotNode extends FigureNode<LightRobot> {
  readonly #place: LightRobotHost;
  #aside = 0;

  constructor(place: LightRobotHost) {
    super(place);
    this.#place = place;
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
    reportModel(report, robot);
    try {
      await loadShells(robot, manifestUrl, signal, onProgress);
    } catch (cause) {
      signal.throwIfAborted();
      reportBare(report, cause);
    }
  }

  protected override adopted(figure: LightRobot): void {
    figure.aside = this.#aside;
  }
}

/** Creates a robot from a built model's manifest. Rejects with a one-line Error if it can't be shown at all. */
async function loadRobot(manifestUrl: string, tones: LightColors): Promise<LightRobot> {
  const raw = await manifestAt(manifestUrl);
  if (raw.v !== 2) throw new Error('only a built model can be shown without 3D');
  return new LightRobot(readManifest(raw), tones);
}

/** Loads and shows the coarsest level, if there is one. Rejects with a one-line Error that names the file. */
async function loadShells(
  robot: LightRobot,
  manifestUrl: string,
  signal: AbortSignal,
  onProgress: (receivedBytes: number, totalBytes: number) => void,
): Promise<void> {
  const { levels, visuals }: Manifest = robot.manifest;
  const lowest = levels[0];
  if (lowest === undefined) return;
  const level = await fetchLevel(lowest, manifestUrl, visuals.length, signal, (received) =>
    onProgress(received, lowest.bytes),
  );
  const means = await Promise.all(level.pictures.map(meanColor));
  signal.throwIfAborted();
  robot.wear(level, means);
}

/** The mean colour (linear) of a texture, used instead of the texture in the light view; null if it can't be read. */
async function meanColor(picture: Blob): Promise<readonly [number, number, number] | null> {
  try {
    const bitmap = await createImageBitmap(picture, {
      resizeWidth: 1,
      resizeHeight: 1,
      resizeQuality: 'medium',
    });
    const canvas = document.createElement('canvas');
    canvas.width = canvas.height = 1;
    const context = canvas.getContext('2d');
    context?.drawImage(bitmap, 0, 0);
    const data = context?.getImageData(0, 0, 1, 1).data;
    if (data === undefined) return null;
    return [linear(data[0]! / 255), linear(data[1]! / 255), linear(data[2]! / 255)];
  } catch {
    return null;
  }
}
