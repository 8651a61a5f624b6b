import type { Box3, Matrix4, Object3D, Ray } from 'three';
import type { LinkBox } from '../../model/bounds.ts';
import type { LinkLook, PosedBody } from '../../model/posed_body.ts';

/** The same robot once more, see-through, in another pose. It goes with its robot. */
export interface FigureGhost {
  /** Turns its joints; rad or m by URDF name. False when nothing changed: then there is nothing to draw. */
  setJoints(joints: ReadonlyMap<string, number>): boolean;
  /** How a link is shown; a ghost can only fade and hide. */
  setLook(link: string, look: LinkLook): void;
  dispose(): void;
}

/** A robot as the scene handles it, whatever it was read from. */
export interface Figure extends PosedBody {
  readonly root: Object3D;
  /** Those of its joints that turn without end. */
  readonly continuousNames: readonly string[];
  readonly boxes: Iterable<readonly [link: { readonly matrixWorld: Matrix4 }, box: LinkBox]>;
  /** world_from_link of the newest `place` or `ground`, column-major. */
  linkMatrix(name: string): Matrix4 | undefined;
  /** Turns the joints; rad or m. False when nothing changed: then there is nothing to draw. */
  setJoints(joints: ReadonlyMap<string, number>): boolean;
  /** Puts the root link at a place in the world and computes where every link is. */
  place(xyz: readonly [number, number, number], quat_wxyz: readonly [number, number, number, number]): void;
  /** Stands the robot at the world's origin, its lowest point on the floor, turned as told: upright without. */
  ground(quat_wxyz?: readonly [number, number, number, number]): void;
  /** The world's box around everything that is drawn, or around the link origins while nothing is. */
  bounds(into: Box3): Box3;
  /** The link that a ray in the world meets first. */
  pick(ray: Ray): string | null;
  /** How a link is shown from now on. */
  setLook(link: string, look: LinkLook): void;
  ghost(): FigureGhost;
  dispose(): void;
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
