import type { Box3, Matrix4, Object3D, Ray } from 'three';
import type { Quat, Vec3 } from '../twin/rotation.ts';
import type { LinkBox } from './grounding.ts';
import type { LinkLook } from './skin.ts';
import type { Transform } from './vectors.ts';

/** A joint that turns or slides. */
export interface FigureJoint {
  /** The link it moves, whose origin is where it sits. */
  readonly link: string;
  /** A unit vector in that link's frame. */
  readonly axis: Vec3;
  readonly slides: boolean;
}

/** Where a link's colour is to say something else than its own: sRGB 0xrrggbb. */
export interface LinkTint {
  readonly color: number;
  /** Striped, too: a second sign beside the colour. */
  readonly hatched: boolean;
}

/** world_from_link, 16 numbers, column after column; three's Matrix4 is one. */
interface Placement {
  readonly elements: Transform;
}

/** A robot in a pose, as whoever draws about it needs it, whatever it is drawn with. Links and joints go by the URDF's
 *  names. */
export interface PosedBody {
  /** world_from_root; everything drawn hangs below it. */
  readonly root: { readonly matrixWorld: Placement };
  readonly linkNames: readonly string[];
  /** Joints that can move. */
  readonly jointNames: readonly string[];
  /** For each link that shows something, where it is and its bounding box. */
  readonly boxes: Iterable<readonly [link: { readonly matrixWorld: Placement }, box: LinkBox]>;
  linkMatrix(name: string): Placement | undefined;
  /** root_from_link as the joints have it, a unit quaternion; null for a link that the model does not have. */
  rootTurn(name: string): Quat | null;
  /** undefined for one that cannot move or that the model does not have. */
  joint(name: string): FigureJoint | undefined;
  /** Around what the link shows, in its own frame, metres. */
  linkBox(name: string): LinkBox | undefined;
  /** For each link but the root: its parent link's name and its own. */
  bones(): Iterable<readonly [parent: string, child: string]>;
  /** Paints a link over; null gives it its own colours back. */
  setTint(link: string, tint: LinkTint | null): void;
  /** Marks these links, and no others, as ones that nobody knows the place of now; that goes before any tint. */
  markUnread(links: ReadonlySet<string>): void;
}

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
