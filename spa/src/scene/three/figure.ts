import type { Box3, Matrix4, Object3D, Ray } from 'three';
import type { LinkBox } from '../../model/bounds.ts';
import type { StagedFigure } from '../figure/figure_node.ts';

export type { FigureGhost } from '../figure/figure_node.ts';

/** A robot as the scene handles it, independent of the kind of model. */
export interface Figure extends StagedFigure {
  readonly root: Object3D;
  readonly boxes: Iterable<readonly [link: { readonly matrixWorld: Matrix4 }, box: LinkBox]>;
  /** world_from_link of the newest `place` or `ground`, column-major. */
  linkMatrix(name: string): Matrix4 | undefined;
  /** The bounding box (world) of all link boxes and link origins. */
  bounds(into: Box3): Box3;
  /** The first link that a ray (world) hits, or null. */
  pick(ray: Ray): string | null;
}

/** What a model's loader needs from the scene. */
export interface Stage {
  /** Aborted when another model replaces this one. */
  readonly signal: AbortSignal;
  /** Shows a new figure, with a skeleton until `skinned` is called. */
  show(figure: Figure): void;
  /** The figure now has meshes: the skeleton is removed. */
  skinned(): void;
  /** Part of the figure is new: it must be placed and drawn again. */
  changed(): void;
  /** Creates a mark for a mesh that can't be shown. */
  placeholder(): Object3D;
}
