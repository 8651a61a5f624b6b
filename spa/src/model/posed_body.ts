import { KinematicTree } from '../twin/kinematic_tree.ts';
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
  /** The root link's place in the world (world_from_root); everything that is drawn hangs on it. */
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

type Tree = Pick<PosedBody, 'jointNames' | 'linkNames' | 'joint' | 'bones'>;

/** The kinematic tree of a body: its links, each with its parent and the joint that moves it. */
export function treeOf(body: Tree): KinematicTree {
  const moved = new Map<string, string>();
  for (const name of body.jointNames) {
    const link = body.joint(name)?.link;
    if (link !== undefined) moved.set(link, name);
  }
  const parents = new Map([...body.bones()].map(([parent, child]) => [child, parent]));
  const links = body.linkNames.map((link) => ({
    link,
    parent: parents.get(link) ?? null,
    joint: moved.get(link) ?? null,
  }));
  return new KinematicTree(links);
}

/** For each link, the joint that moves it or moves the link it is fixed to; null if no joint moves it. */
export function jointOfLinks(body: Tree): Map<string, string | null> {
  const tree = treeOf(body);
  return new Map(body.linkNames.map((link) => [link, tree.jointOf(link)]));
}

/** The child links of these joints and the links fixed to them. */
export function linksMovedBy(body: Tree, joints: ReadonlySet<string>): Set<string> {
  const moved = new Set<string>();
  for (const [link, joint] of jointOfLinks(body)) if (joint !== null && joints.has(joint)) moved.add(link);
  return moved;
}

/** The child links of these joints and all links below them, including those beyond further joints; in the model's order. */
export function linksBeyond(body: Tree, joints: readonly string[]): string[] {
  const moved = new Set(joints.map((name) => body.joint(name)?.link));
  const parents = new Map([...body.bones()].map(([parent, child]) => [child, parent]));
  const isMoved = (link: string | undefined): boolean =>
    link !== undefined && (moved.has(link) || isMoved(parents.get(link)));
  return body.linkNames.filter((link) => isMoved(link));
}
