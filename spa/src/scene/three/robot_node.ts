import {
  BufferAttribute,
  BufferGeometry,
  type Color,
  Group,
  LineBasicMaterial,
  LineSegments,
  type Object3D,
  type Ray,
} from 'three';
import { NotNow } from '../../model/bundle.ts';
import { manifestAt } from '../../model/files.ts';
import { readManifest } from '../../model/manifest.ts';
import type { ModelReport } from '../../model/report.ts';
import type { LocalRobot } from '../../urdf/local_robot.ts';
import { FigureNode, type NodeHost, type OnProgress } from '../figure/figure_node.ts';
import type { Box } from '../figure/robot_row.ts';
import { BuiltRobot, type Stage } from './built_robot.ts';
import { Download, readRawManifest } from './raw_bundle.ts';
import { ShadowCaster } from './shadow.ts';
import type { SkinTones } from './skin.ts';
import type { SkinnedRobot } from './skinned_robot.ts';
import { StaleEffect } from './stale_effect.ts';
import type { SceneTheme } from './theme.ts';

/** Lines from link to link, which show the robot's motion before any mesh is loaded. */
class Skeleton {
  readonly lines: LineSegments;
  readonly #ends: readonly string[];

  constructor(figure: SkinnedRobot, color: Color) {
    this.#ends = [...figure.bones()].flat();
    const position = new BufferAttribute(new Float32Array(this.#ends.length * 3), 3);
    const geometry = new BufferGeometry().setAttribute('position', position);
    this.lines = new LineSegments(geometry, new LineBasicMaterial({ color, toneMapped: false }));
    this.lines.frustumCulled = false; // its bounds change with every pose
  }

  follow(figure: SkinnedRobot): void {
    const position = this.lines.geometry.getAttribute('position');
    for (const [i, name] of this.#ends.entries()) {
      const m = figure.linkMatrix(name)?.elements;
      if (m !== undefined) position.setXYZ(i, m[12]!, m[13]!, m[14]!);
    }
    position.needsUpdate = true;
  }

  dispose(): void {
    this.lines.removeFromParent();
    this.lines.geometry.dispose();
    (this.lines.material as LineBasicMaterial).dispose();
  }
}

/** What a robot needs from its scene. */
export interface RobotNodeHost extends NodeHost {
  readonly tones: SkinTones;
  theme(): SceneTheme;
  /** Creates a mark for a mesh that can't be shown. */
  placeholder(): Object3D;
}

/** One robot in a three.js scene: loads and draws its model, skeleton and shadow. */
export class RobotNode extends FigureNode<SkinnedRobot> {
  /** Everything drawn for it. */
  readonly object = new Group();
  /** Its position beside other robots: scene_from_world of this robot's own world, metres. */
  readonly #slot = new Group();
  readonly staleEffect: StaleEffect;
  readonly #place: RobotNodeHost;
  #built: BuiltRobot | null = null;
  #skeleton: Skeleton | null = null;
  #caster: ShadowCaster | null = null;
  #coarse = false;

  constructor(place: RobotNodeHost) {
    super(place);
    this.#place = place;
    this.object.add(this.#slot);
    this.staleEffect = new StaleEffect(place.theme().stale);
  }

  standAside(y: number): void {
    if (this.#slot.position.y === y) return;
    this.#slot.position.y = y;
    this.#slot.updateMatrixWorld(true);
    this.put();
  }

  /** Whether it is shown with meshes, not just as a skeleton. */
  get dressed(): boolean {
    return this.figure !== null && this.#skeleton === null;
  }

  /** Like `load`, for a robot whose files are already in this browser. */
  loadLocal(robot: LocalRobot): Promise<ModelReport> {
    return this.supersede(async (signal, report) => {
      const { showRaw } = await loadRaw();
      await showRaw(robot, this.#stage(signal), this.staleEffect, this.#place.tones, report, () => {});
      this.#place.framed(true);
    });
  }

  setTheme(theme: SceneTheme): void {
    this.staleEffect.setTone(theme.stale);
  }

  /** Bytes that `refine` would fetch; null if there is nothing finer, or only levels too large for this device. */
  get finerBytes(): number | null {
    return this.#built?.finestBytes ?? null;
  }

  /** Shows the finest level. Rejects with a one-line Error if it can't be loaded; the current level stays until then. */
  async refine(onProgress: (receivedBytes: number, totalBytes: number) => void): Promise<void> {
    await this.#built?.refine(onProgress);
  }

  /** Whether it has a built model, which the light view can show as well. */
  get built(): boolean {
    return this.#built !== null;
  }

  /** Whether it is limited to a coarser level than available, for a slow device. */
  get coarse(): boolean {
    return this.#coarse && this.#built?.hasLevels === true;
  }

  /** Sets whether only its coarsest level is shown, for a slow device. */
  keepCoarse(coarse: boolean): void {
    this.#coarse = coarse;
    void this.#built?.keepCoarse(coarse);
  }

  /** The first link that a ray (world) hits, or null. */
  pick(ray: Ray): string | null {
    return this.figure?.pick(ray) ?? null;
  }

  box(): Box | null {
    return this.figure?.bounds() ?? null;
  }

  override dispose(): void {
    super.dispose();
    this.object.removeFromParent();
  }

  protected override async read(
    manifestUrl: string,
    onProgress: OnProgress,
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
      const { fetchUrdf, showRaw } = await loadRaw();
      const manifest = readRawManifest(raw);
      // Which files are drawn is known only once the URDF has been read; until then, all count.
      let total = [...manifest.files.values()].reduce((sum, file) => sum + file.size, 0);
      const files = new Download(manifestUrl, signal, (received) => onProgress(received, total));
      const urdf = await fetchUrdf(manifest, files);
      signal.throwIfAborted();
      const model = { urdf, manifest, files };
      await showRaw(model, stage, this.staleEffect, this.#place.tones, report, (needed) => {
        total = needed;
      });
    }
  }

  #stage(signal: AbortSignal): Stage {
    return {
      signal,
      show: (figure) => {
        signal.throwIfAborted();
        this.adopt(figure);
      },
      skinned: () => {
        this.#skeleton?.dispose();
        this.#skeleton = null;
        this.put();
      },
      changed: () => this.put(),
      placeholder: () => this.#place.placeholder(),
    };
  }

  protected override adopted(figure: SkinnedRobot): void {
    this.#skeleton = new Skeleton(figure, this.#place.theme().muted);
    this.#caster = new ShadowCaster(figure.linkNames.length);
    this.#slot.add(figure.root);
    this.object.add(this.#skeleton.lines, this.#caster.blocks); // these follow the links in the scene's world
  }

  protected override moved(figure: SkinnedRobot): void {
    this.#skeleton?.follow(figure);
    this.#caster?.follow(figure.boxes);
  }

  protected override clear(): void {
    this.#caster?.dispose();
    this.#skeleton?.dispose();
    this.#caster = this.#skeleton = this.#built = null;
    super.clear();
  }

  protected override faded(grey: number): void {
    this.staleEffect.amount = grey;
  }
}

/** Loads the code that draws raw files. Rejects with NotNow if that fails. */
function loadRaw() {
  return import('./raw_robot.ts').catch((cause: unknown) => {
    throw new NotNow('the code for raw files did not come', { cause });
  });
}
