import type { Quat, Vec3 } from '../twin/rotation.ts';
import type { LinkBox } from './bounds.ts';
import type { Transform } from './vectors.ts';

/** A joint that turns or slides. */
export interface BodyJoint {
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
  joint(name: string): BodyJoint | undefined;
  /** Around what the link shows, in its own frame, metres. */
  linkBox(name: string): LinkBox | undefined;
  /** For each link but the root: its parent link's name and its own. */
  bones(): Iterable<readonly [parent: string, child: string]>;
  /** Paints a link over; null gives it its own colours back. */
  setTint(link: string, tint: LinkTint | null): void;
  /** Marks these links, and no others, as ones that nobody knows the place of now; that goes before any tint. */
  markUnread(links: ReadonlySet<string>): void;
}

/** How one link is shown. Each is 0…1; a link at rest has none of them. */
export interface LinkLook {
  /** How much of the accent it takes. */
  highlight?: number;
  /** How far it lets one see through; 1 is gone, but still there for picking. */
  fade?: number;
  /** Not drawn and not picked. */
  hide?: boolean;
}
