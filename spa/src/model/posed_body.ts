import type { Quat, Vec3 } from '../twin/rotation.ts';
import type { LinkBox } from './bounds.ts';
import type { Manifest } from './manifest.ts';
import type { Transform } from './vectors.ts';

/** A revolute or prismatic joint. */
export interface BodyJoint {
  /** Its child link, whose origin is at the joint. */
  readonly link: string;
  /** A unit vector in that link's frame. */
  readonly axis: Vec3;
  readonly slides: boolean;
}

/** A colour (sRGB 0xrrggbb) that replaces a link's own colour, to show a value. */
export interface LinkTint {
  readonly color: number;
  /** Also striped, as a second sign for people who can't tell the colours. */
  readonly hatched: boolean;
}

/** world_from_link: 16 numbers, column-major. A Matrix4 of three.js fits. */
interface Placement {
  readonly elements: Transform;
}

/** A link's bounding box in its own frame, with the link's world transform. */
export type PlacedBox = readonly [link: { readonly matrixWorld: Placement }, box: LinkBox];

/** A posed robot as seen by the overlays, independent of the renderer. Links and joints are identified by their URDF names. */
export interface PosedBody {
  readonly manifest: Manifest;
  /** world_from_root, the parent of everything drawn. */
  readonly root: { readonly matrixWorld: Placement };
  readonly linkNames: readonly string[];
  /** Joints that can move. */
  readonly jointNames: readonly string[];
  /** For each link with visuals: its world transform, and its bounding box in its own frame. */
  readonly boxes: Iterable<PlacedBox>;
  linkMatrix(name: string): Placement | undefined;
  /** The rotation of root_from_link given the joint angles, a unit quaternion; null for a link that the model lacks. */
  rootTurn(name: string): Quat | null;
  /** A joint by name; undefined for one that cannot move or that the model lacks. */
  joint(name: string): BodyJoint | undefined;
  /** A joint's position, rad or m; null for one that cannot move or that the model lacks. */
  jointValue(name: string): number | null;
  /** Bounding box of the link's visuals, in its own frame, metres. */
  linkBox(name: string): LinkBox | undefined;
  /** For each link but the root: its parent link's name and its own. */
  bones(): Iterable<readonly [parent: string, child: string]>;
  /** Tints a link; null restores its own colours. */
  setTint(link: string, tint: LinkTint | null): void;
  /** Marks exactly these links as having an unknown place now. The mark takes precedence over any tint. */
  markUnread(links: ReadonlySet<string>): void;
}

/** Display options of a link; an ordinary link has none of these. */
export interface LinkLook {
  /** How much of the accent colour is mixed in, 0…1. */
  highlight?: number;
  /** Transparency, 0…1; at 1 it is invisible but can still be picked. */
  fade?: number;
  /** Not drawn and not picked. */
  hide?: boolean;
}
