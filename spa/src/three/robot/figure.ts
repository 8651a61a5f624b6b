import type { Box3, Matrix4, Object3D, Ray } from 'three';
import type { LinkBox } from '../../model/bounds.ts';
import type { StagedFigure } from '../../view/figure_node.ts';

export type { FigureGhost } from '../../view/figure_node.ts';

/** A robot as the scene handles it, whatever it was read from. */
export interface Figure extends StagedFigure {
  readonly root: Object3D;
  readonly boxes: Iterable<readonly [link: { readonly matrixWorld: Matrix4 }, box: LinkBox]>;
  /** world_from_link of the newest `place` or `ground`, column-major. */
  linkMatrix(name: string): Matrix4 | undefined;
  /** The world's box around everything that is drawn, or around the link origins while nothing is. */
  bounds(into: Box3): Box3;
  /** The link that a ray in the world meets first. */
  pick(ray: Ray): string | null;
}

/** What showing a robot needs of the scene, and may ask it for. */
export interface Stage {
  /** Aborted when another model takes this one's place. */
  readonly signal: AbortSignal;
  /** Shows a new figure, as a skeleton until `skinned`. */
  show(figure: Figure): void;
  /** The figure is drawn by itself now: the skeleton goes. */
  skinned(): void;
  /** Something of the figure is new: place it again and draw it. */
  changed(): void;
  /** A mark for a mesh that can't be shown. */
  placeholder(): Object3D;
}
