import type { Joint as ModelJoint } from '../model/kinematics.ts';
import type { Manifest } from '../model/manifest.ts';
import { quatOfRpy } from '../model/vectors.ts';
import { type Bone, bonesOf, DEFAULT_AXIS, unit } from './bones.ts';
import { massesOf } from './masses.ts';
import { buildTree, type Tree } from './tree.ts';
import {
  type Joint,
  materialOf,
  SCALAR_TYPES,
  type Shape,
  UNBOUNDED,
  type Urdf,
  type Vector,
  type Visual,
} from './types.ts';

/** A URDF converted to a built model's manifest (docs/reference/model-bundle.md), so that the same code moves and draws both. */
export interface UrdfModel {
  /** The manifest, without levels: those are built from `shapes` as meshes are loaded. A mesh's box is null. */
  readonly manifest: Manifest;
  /** The shape of each of the manifest's visuals, in the same order. */
  readonly shapes: readonly PlacedShape[];
  /** What was left out, or interpreted differently from how it is written, one line each. */
  readonly problems: readonly string[];
}

/** A shape with its pose and colour. */
export interface PlacedShape {
  readonly shape: Shape;
  /** Drawn instead of the shape, for a link without one: its bones; null for a shape. */
  readonly bones: readonly Bone[] | null;
  /** link_from_visual: metres, and a unit quaternion w, x, y, z. */
  readonly xyz: Vector;
  readonly quat: readonly [number, number, number, number];
  /** Its colour in the URDF; null if none is given. */
  readonly paint: Paint | null;
}

/** Red, green, blue (linear) and opacity, 0…1. */
export type Paint = readonly [number, number, number, number];

/** A URDF that can't be shown; the message is one line. */
export class UrdfError extends Error {}

/** Converts a URDF. A robot whose links mostly have no visuals gets bones. `canBeDrawn`: whether a mesh's URI has a file. Throws
 *  UrdfError if there is no root link. */
export function modelOf(urdf: Urdf, canBeDrawn: (uri: string) => boolean = () => true): UrdfModel {
  const tree = buildTree(urdf);
  const { root, joints } = tree;
  if (root === null)
    throw new UrdfError(
      urdf.links.length === 0 ? 'URDF: no links' : 'URDF: no root, its links form a circle',
    );
  const links = [root.name, ...joints.map(({ child }) => child)];
  const named = links.flatMap((name, link) =>
    tree.links.get(name)!.visuals.flatMap((visual) => (visual.shape === null ? [] : [{ link, visual }])),
  );
  const shown = named.filter(({ visual: { shape } }) => shape!.uri === '' || canBeDrawn(shape!.uri));
  let bones = bonesOf(tree, new Set(shown.map(({ link }) => link)));
  // A few collision shapes, often crude hulls, would hide the skeleton.
  const crude = bones.size > 0 && urdf.findings.some(({ code }) => code === 'collisions-shown');
  if (crude) bones = bonesOf(tree, new Set());
  const drawn = crude ? [] : named;
  const boned = [...bones.keys()];
  const shapes = [
    ...drawn.map(({ visual }) => placed(visual, visual.shape!, urdf)),
    ...boned.map((link) => ({ ...UNMOVED, bones: bones.get(link)! })),
  ];
  const found = [...urdf.findings, ...tree.findings].filter(({ severity }) => severity === 'error');
  return {
    manifest: {
      robot: urdf.name,
      levels: [],
      links,
      joints: jointsOf(tree, new Map(links.map((name, i) => [name, i]))),
      visuals: [...drawn.map(({ link }) => link), ...boned].map((link, i) => {
        const { shape, bones } = shapes[i]!;
        const source = bones === null ? shape.uri || shape.kind : 'bones';
        return { link, source, box: null, placeholder: null };
      }),
      thumbnail: null,
      missing: [],
      findings: [],
      raw: { v: RAW, ...massesOf(tree, urdf.findings) },
    },
    shapes,
    problems: found.map(({ text }) => text),
  };
}

/** The version of a manifest for raw files (docs/reference/model-bundle.md), for which no soles have been determined. */
const RAW = 1;

/** The pose of a link's bones: in its own frame. */
const UNMOVED: PlacedShape = {
  shape: { kind: 'box', uri: '', scale: [1, 1, 1], dims: [], line: null },
  bones: null,
  xyz: [0, 0, 0],
  quat: [1, 0, 0, 0],
  paint: null,
};

function placed(visual: Visual, shape: Shape, urdf: Urdf): PlacedShape {
  const material = materialOf(visual, urdf);
  // Textures are not drawn: a material that has only a texture is white.
  const rgba = material?.rgba ?? (material?.texture == null ? null : [1, 1, 1, 1]);
  return {
    shape,
    bones: null,
    xyz: visual.xyz,
    quat: quatOfRpy(visual.rpy),
    paint: rgba === null ? null : paintOf(rgba),
  };
}

/** Converts a URDF's rgba, which RViz and Gazebo take as sRGB, to linear light. What has opacity 0 is invisible, as there. */
function paintOf([r = 0, g = 0, b = 0, opacity = 1]: readonly number[]): Paint {
  return [linear(r), linear(g), linear(b), opacity];
}

/** Decodes sRGB to linear light, 0…1 (IEC 61966-2-1). */
export function linear(display: number): number {
  return display <= 0.04045 ? display / 12.92 : ((display + 0.055) / 1.055) ** 2.4;
}

function jointsOf({ joints, follows }: Tree, linkOf: ReadonlyMap<string, number>): ModelJoint[] {
  const indexOf = new Map(joints.map((joint, i) => [joint, i]));
  return joints.map((joint) => {
    const { name, type, xyz, rpy } = joint;
    const follow = follows.get(name);
    const axis = (joint.axis && unit(joint.axis)) ?? DEFAULT_AXIS;
    return {
      name,
      type,
      parent: linkOf.get(joint.parent)!,
      xyz,
      quat: quatOfRpy(rpy),
      axis,
      plane: type === 'planar' ? planeAcross(axis) : null,
      limits: limitsOf(joint),
      mimic:
        follow === undefined
          ? null
          : { joint: indexOf.get(follow.leader)!, multiplier: follow.multiplier, offset: follow.offset },
    };
  });
}

/** Directions x and y of the plane across a unit axis: those of the frame, after the shortest rotation that maps z to the axis
 *  (docs/reference/model-bundle.md). */
function planeAcross([a, b, c]: Vector): readonly [Vector, Vector] {
  if (c < -1 + 1e-9)
    return [
      [1, 0, 0],
      [0, -1, 0],
    ]; // all rotations by 180° are equally short: use the one about x
  const d = 1 / (1 + c);
  return [
    [1 - a * a * d, -a * b * d, -a],
    [-a * b * d, 1 - b * b * d, -b],
  ];
}

function limitsOf({ type, limit }: Joint): ModelJoint['limits'] {
  if (limit === null || !SCALAR_TYPES.has(type) || type === 'continuous') return null;
  const [lower, upper] = [limit.lower ?? 0, limit.upper ?? 0];
  return Math.max(Math.abs(lower), Math.abs(upper)) < UNBOUNDED ? { lower, upper } : null;
}
