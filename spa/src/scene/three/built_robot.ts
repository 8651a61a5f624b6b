import type { Object3D } from 'three';
import { savesData } from '../../browser/late_part.ts';
import { fetchLevel } from '../../model/lod.ts';
import type { Manifest } from '../../model/manifest.ts';
import type { ModelReport } from '../../model/report.ts';
import { type OnProgress, reportBare, reportModel } from '../figure/figure_node.ts';
import type { SkinTones } from './skin.ts';
import { SkinnedRobot } from './skinned_robot.ts';
import type { StaleEffect } from './stale_effect.ts';

/** What a model's loader needs from the scene. */
export interface Stage {
  /** Aborted when another model replaces this one. */
  readonly signal: AbortSignal;
  /** Shows a new figure, with a skeleton until `skinned` is called. */
  show(robot: SkinnedRobot): void;
  /** The figure now has meshes: the skeleton is removed. */
  skinned(): void;
  /** Part of the figure is new: it must be placed and drawn again. */
  changed(): void;
  /** Creates a mark for a mesh that can't be shown. */
  placeholder(): Object3D;
}

/**
 * Loads a built model into the scene step by step: a skeleton at once, then the coarsest level of detail, then the next one when
 * the browser is idle, and the finest on request.
 */
export class BuiltRobot {
  readonly #manifest: Manifest;
  readonly #url: string;
  readonly #stage: Stage;
  readonly #robot: SkinnedRobot;
  /** Index of the level that is shown; -1 while it is a skeleton. */
  #shown = -1;
  #refining: Promise<void> | null = null;
  #coarse = false;

  constructor(
    manifest: Manifest,
    manifestUrl: string,
    stage: Stage,
    staleEffect: StaleEffect,
    tones: SkinTones,
  ) {
    this.#manifest = manifest;
    this.#url = manifestUrl;
    this.#stage = stage;
    this.#robot = new SkinnedRobot(manifest, staleEffect, tones);
    stage.show(this.#robot);
  }

  /** Loads and shows the coarsest level. Errors go into the report; the skeleton moves in any case. */
  async dress(report: ModelReport, onProgress: OnProgress): Promise<void> {
    reportModel(report, this.#robot);
    if (this.#manifest.levels.length === 0) return;
    try {
      await this.#wear(0, onProgress);
    } catch (cause) {
      this.#stage.signal.throwIfAborted();
      reportBare(report, cause);
      return;
    }
    const next = nextWhenIdle(this.#manifest.levels.length);
    if (next > 0) {
      whenIdle(() => {
        // This level was loaded automatically, so a failure is not reported.
        if (!this.#stage.signal.aborted && this.#shown < next)
          void this.#refine(next, () => {}).catch(() => {});
      });
    }
  }

  /** Size of the finest level in bytes; null if it is already shown or too large for this device. */
  get finestBytes(): number | null {
    const finest = this.#manifest.levels.length - 1;
    if (this.#shown < 0 || this.#shown >= finest || isSmallDevice()) return null;
    return this.#manifest.levels[finest]!.bytes;
  }

  /** Shows the finest level. Rejects with a one-line Error if it can't be loaded; the current level stays until then. */
  refine(onProgress: OnProgress): Promise<void> {
    return this.#refine(this.#manifest.levels.length - 1, onProgress);
  }

  /** Whether there is a coarser level than the finest. */
  get hasLevels(): boolean {
    return this.#manifest.levels.length > 1;
  }

  /** Sets whether only the coarsest level is shown. Never rejects: if a level can't be loaded, the current one stays. */
  async keepCoarse(coarse: boolean): Promise<void> {
    if (coarse === this.#coarse) return;
    this.#coarse = coarse;
    await this.#refining?.catch(() => {});
    if (this.#shown < 0 || coarse !== this.#coarse) return;
    const next = nextWhenIdle(this.#manifest.levels.length);
    if (!coarse) await this.#refine(next, () => {}).catch(() => {});
    else if (this.#shown > 0) {
      this.#refining = this.#wear(0, () => {});
      await this.#refining.catch(() => {});
    }
  }

  async #refine(level: number, onProgress: OnProgress): Promise<void> {
    await this.#refining?.catch(() => {}); // one at a time, so that a coarser level can't replace a finer one
    if (this.#shown >= level || this.#coarse) return;
    this.#refining = this.#wear(level, onProgress);
    await this.#refining;
  }

  async #wear(index: number, onProgress: OnProgress): Promise<void> {
    const file = this.#manifest.levels[index]!;
    const { signal } = this.#stage;
    const level = await fetchLevel(file, this.#url, this.#manifest.visuals.length, signal, (received) =>
      onProgress(received, file.bytes),
    );
    const pictures = await Promise.all(
      level.pictures.map((picture) =>
        // A texture that can't be read must not prevent the level from being shown.
        createImageBitmap(picture, { premultiplyAlpha: 'none' }).catch(() => null),
      ),
    );
    signal.throwIfAborted();
    this.#robot.wear(level, pictures);
    this.#shown = index;
    this.#stage.skinned();
  }
}

/** Index of the level to load automatically: the second coarsest, or the coarsest if the viewer's browser saves data. */
function nextWhenIdle(levels: number): number {
  return savesData() ? 0 : Math.min(1, levels - 1);
}

/** Whether this is a phone, where the finest level would cost too much memory and battery. */
function isSmallDevice(): boolean {
  return window.matchMedia('(pointer: coarse)').matches && Math.min(screen.width, screen.height) < 700;
}

function whenIdle(task: () => void): void {
  // WebKit has no idle callback, so a pause after the first picture is used instead.
  if ('requestIdleCallback' in window) window.requestIdleCallback(task, { timeout: 3000 });
  else setTimeout(task, 500);
}
