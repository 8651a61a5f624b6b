import type { Object3D } from 'three';
import {
  type Box3,
  BufferAttribute,
  BufferGeometry,
  Color,
  FrontSide,
  type Material,
  Matrix4,
  Mesh,
  Quaternion,
  type Ray,
  Raycaster,
  Vector3,
} from 'three';
import URDFLoader, { type URDFRobot } from 'urdf-loader';
import { emptyBox, growBox, type LinkBox, lowestZ } from '../../model/bounds.ts';
import type { BodyJoint, LinkLook, LinkTint } from '../../model/posed_body.ts';
import { UNREAD } from '../../overlays/colors.ts';
import type { Quat } from '../../twin/rotation.ts';
import type { Welded } from '../../urdf/weld.ts';
import type { Figure } from '../robot/figure.ts';
import { readUrdf } from './document.ts';
import { slidesOrTurns, UrdfJoints } from './joints.ts';
import type { MeshPart } from './mesh_loader.ts';
import type { Palette } from './palette.ts';
import { RawGhost } from './raw_ghost.ts';

/** The shade of a shell for which neither URDF nor mesh names one. */
const UNPAINTED = new Color(0xc4cad3);
/** The upper bits of each part of a colour: a handful of shades on a ramp. */
const SHADES = 0xf0f0f0;

/** A place of the robot that a mesh file fills. */
export interface MeshSlot {
  readonly link: string;
  /** As the URDF writes it. */
  readonly uri: string;
  readonly worldZ: number;
  fill(parts: readonly MeshPart[]): void;
  /** Puts something else there, in the link's frame. */
  mark(placeholder: Object3D): void;
}

/**
 * A robot as three.js objects, with the robot's own frames (Z up). The adapter around urdf-loader: nothing else in
 * the scene knows it, so that another reader can take its place.
 */
export class UrdfRobot implements Figure {
  readonly root: Object3D;
  readonly problems: readonly string[];
  readonly slots: readonly MeshSlot[];
  readonly #robot: URDFRobot;
  readonly #palette: Palette;
  readonly #joints: UrdfJoints;
  /** What it was read from, mended. */
  readonly #source: Element;
  readonly #ghosts = new Set<RawGhost>();
  /** For each link that shows something, its bounding box. */
  readonly boxes: ReadonlyMap<Object3D, LinkBox>;
  readonly #boxes = new Map<Object3D, LinkBox>();
  /** What tinted shells are painted with by themselves. */
  readonly #untinted = new Map<Mesh, Material>();
  readonly #owned = new Set<BufferGeometry>();
  #unread: ReadonlySet<string> = new Set();
  /** Links that show the same mesh file share its buffers. */
  readonly #geometries = new Map<Welded, BufferGeometry>();

  /** Throws an Error of one line when the text is no URDF that can be drawn. */
  constructor(urdf: string, palette: Palette) {
    const { robot, problems } = readUrdf(urdf);
    const slots: Mesh[] = [];
    const loader = new URDFLoader();
    // The loader's own way to files is left alone: it would resolve paths and fetch by itself.
    loader.loadMeshCb = (_path, _manager, material, done) => {
      const slot = new Mesh(new BufferGeometry(), material);
      slot.visible = false;
      slots.push(slot);
      done(slot);
    };
    this.#robot = loader.parse(robot);
    this.root = this.#robot;
    this.problems = problems;
    this.boxes = this.#boxes;
    this.#palette = palette;
    this.#joints = new UrdfJoints(this.#robot);
    this.#source = robot;
    this.#finishPrimitives(new Set(slots));
    this.slots = slots.map((mesh) => this.#slot(mesh));
  }

  get jointNames(): string[] {
    return this.#joints.names;
  }

  get continuousNames(): string[] {
    const continuous = this.#joints.joints.filter(({ jointType }) => jointType === 'continuous');
    return continuous.map(({ name }) => name);
  }

  get linkNames(): string[] {
    return Object.keys(this.#robot.links);
  }

  /** world_from_link of the newest `place`, column-major. */
  linkMatrix(name: string): Matrix4 | undefined {
    return this.#robot.links[name]?.matrixWorld;
  }

  rootTurn(name: string): Quat | null {
    const link = this.#robot.links[name];
    if (link === undefined) return null;
    this.root.updateMatrixWorld(true);
    TURN.setFromRotationMatrix(
      ROOT_FROM_LINK.copy(this.root.matrixWorld).invert().multiply(link.matrixWorld),
    );
    return [TURN.w, TURN.x, TURN.y, TURN.z];
  }

  joint(name: string): BodyJoint | undefined {
    const joint = this.#robot.joints[name];
    if (joint === undefined || !slidesOrTurns(joint)) return undefined;
    const link = joint.children.find((child) => 'isURDFLink' in child);
    if (link === undefined) return undefined;
    return { link: link.name, axis: joint.axis.toArray(), slides: joint.jointType === 'prismatic' };
  }

  linkBox(name: string): LinkBox | undefined {
    const link = this.#robot.links[name];
    return link === undefined ? undefined : this.#boxes.get(link);
  }

  /** For each link but the root: its parent link's name and its own. */
  *bones(): Generator<[parent: string, child: string]> {
    for (const [child, link] of Object.entries(this.#robot.links)) {
      const parent = link.parent?.parent;
      if (parent !== null && parent !== undefined) yield [parent.name, child];
    }
  }

  setJoints(joints: ReadonlyMap<string, number>): boolean {
    return this.#joints.set(joints);
  }

  /** Puts the root link at a place in the world and computes every link's matrix. */
  place(xyz: readonly [number, number, number], quat_wxyz: readonly [number, number, number, number]): void {
    const [w, x, y, z] = quat_wxyz;
    this.root.position.set(...xyz);
    this.root.quaternion.set(x, y, z, w).normalize();
    this.root.updateMatrixWorld(true);
  }

  /** Stands the robot upright at the world's origin, its lowest point on the floor. */
  ground(quat_wxyz: readonly [number, number, number, number] = [1, 0, 0, 0]): void {
    this.place([0, 0, 0], quat_wxyz);
    const low = this.#lowest();
    if (low !== 0) this.place([0, 0, -low], quat_wxyz);
  }

  /** The world's box around everything that is drawn, or around the link origins while nothing is. */
  bounds(into: Box3): Box3 {
    into.makeEmpty();
    for (const [link, box] of this.#boxes) {
      for (let corner = 0; corner < 8; corner += 1) {
        POINT.set(
          corner & 1 ? box.max[0] : box.min[0],
          corner & 2 ? box.max[1] : box.min[1],
          corner & 4 ? box.max[2] : box.min[2],
        ).applyMatrix4(link.matrixWorld);
        into.expandByPoint(POINT);
      }
    }
    for (const link of Object.values(this.#robot.links)) {
      into.expandByPoint(POINT.setFromMatrixPosition(link.matrixWorld));
    }
    return into;
  }

  pick(ray: Ray): string | null {
    RAYCASTER.ray.copy(ray);
    const [hit] = RAYCASTER.intersectObject(this.root, true);
    for (let at: Object3D | null = hit?.object ?? null; at !== null; at = at.parent) {
      if ('isURDFLink' in at) return at.name;
    }
    return null;
  }

  /** Raw shells share their materials by colour, so only hiding is possible here. */
  setLook(name: string, { hide = false }: LinkLook): void {
    for (const visual of this.#robot.links[name]?.children ?? []) {
      if ('isURDFVisual' in visual) visual.visible = !hide;
    }
  }

  ghost(): RawGhost {
    const loader = new URDFLoader();
    loader.parseVisual = false;
    const ghost = new RawGhost(loader.parse(this.#source), this.#palette.glass(), (gone) =>
      this.#ghosts.delete(gone),
    );
    for (const link of Object.values(this.#robot.links)) {
      for (const visual of link.children) {
        if (!('isURDFVisual' in visual)) continue;
        for (const mesh of visual.children) if (mesh instanceof Mesh) lend(mesh, ghost);
      }
    }
    this.#ghosts.add(ghost);
    this.root.add(ghost.root);
    return ghost;
  }

  markUnread(links: ReadonlySet<string>): void {
    for (const link of this.#unread) if (!links.has(link)) this.setTint(link, null);
    for (const link of links) if (!this.#unread.has(link)) this.setTint(link, UNREAD);
    this.#unread = links;
  }

  /** In steps, because each shade is a material; stripes are for built models. */
  setTint(name: string, tint: LinkTint | null): void {
    for (const visual of this.#robot.links[name]?.children ?? []) {
      if (!('isURDFVisual' in visual)) continue;
      visual.traverse((object) => {
        if (!(object instanceof Mesh)) return;
        const own: Material = this.#untinted.get(object) ?? object.material;
        if (tint === null) {
          object.material = own;
          this.#untinted.delete(object);
        } else {
          this.#untinted.set(object, own);
          const shade = new Color(tint.color & SHADES);
          object.material = this.#palette.shell(shade, own.opacity, own.side === FrontSide);
        }
      });
    }
  }

  dispose(): void {
    this.root.removeFromParent();
    for (const ghost of [...this.#ghosts]) ghost.dispose();
    this.#palette.dispose();
    for (const geometry of this.#owned) geometry.dispose();
  }

  #lowest(): number {
    let low = Number.POSITIVE_INFINITY;
    for (const [link, box] of this.#boxes) low = Math.min(low, lowestZ(box, link.matrixWorld.elements));
    if (Number.isFinite(low)) return low;
    for (const name in this.#robot.links) {
      low = Math.min(low, this.#robot.links[name]!.matrixWorld.elements[14]!);
    }
    return low;
  }

  /** Boxes, balls and cylinders that the URDF describes itself. */
  #finishPrimitives(slots: ReadonlySet<Mesh>): void {
    this.root.traverse((object) => {
      if (!(object instanceof Mesh) || slots.has(object)) return;
      const { color, opacity } = paintOf(object);
      object.material = this.#palette.shell(color, opacity, true);
      this.#owned.add(object.geometry);
      this.#grow(object);
    });
  }

  /** Counts an object's points to its link. */
  #grow(object: Mesh): void {
    const visual = object.parent;
    const link = visual?.parent;
    if (visual === null || link === null || link === undefined) return;
    visual.updateMatrix();
    object.updateMatrix();
    const box = this.#boxes.get(link) ?? emptyBox();
    const points = object.geometry.getAttribute('position').array;
    growBox(box, points, LINK_FROM_MESH.multiplyMatrices(visual.matrix, object.matrix).elements);
    this.#boxes.set(link, box);
    for (const ghost of this.#ghosts) lend(object, ghost);
  }

  #geometry(surface: Welded): BufferGeometry {
    let geometry = this.#geometries.get(surface);
    if (geometry === undefined) {
      geometry = new BufferGeometry();
      geometry.setAttribute('position', new BufferAttribute(surface.positions, 3));
      geometry.setAttribute('normal', new BufferAttribute(surface.normals, 3));
      geometry.setIndex(new BufferAttribute(surface.index, 1));
      this.#geometries.set(surface, geometry);
      this.#owned.add(geometry);
    }
    return geometry;
  }

  #slot(slot: Mesh): MeshSlot {
    const visual = slot.parent!;
    const link = visual.parent!;
    const own = paintOf(slot);
    return {
      link: link.name,
      uri: meshUri(visual),
      get worldZ() {
        return link.matrixWorld.elements[14]!;
      },
      fill: (parts) => {
        slot.removeFromParent();
        for (const { surface, color, opacity } of parts) {
          const paint = color === null ? own : { color, opacity };
          const shell = this.#palette.shell(paint.color, paint.opacity, surface.closed);
          const mesh = new Mesh(this.#geometry(surface), shell);
          visual.add(mesh);
          this.#grow(mesh);
        }
      },
      mark: (placeholder) => {
        slot.removeFromParent();
        link.add(placeholder);
      },
    };
  }
}

const POINT = new Vector3();
const TURN = new Quaternion();
const ROOT_FROM_LINK = new Matrix4();
const RAYCASTER = new Raycaster();
const LINK_FROM_MESH = new Matrix4();

/** Lets a ghost wear a mesh of the body's. */
function lend(mesh: Mesh, ghost: RawGhost): void {
  const visual = mesh.parent;
  if (visual === null || visual.parent === null || !mesh.visible) return;
  visual.updateMatrix();
  mesh.updateMatrix();
  ghost.wear(visual.parent.name, mesh.geometry, LINK_FROM_MESH.multiplyMatrices(visual.matrix, mesh.matrix));
}

function urdfNode(visual: Object3D): Element | null {
  return (visual as Object3D & { urdfNode?: Element | null }).urdfNode ?? null;
}

/** What the author of the URDF saw: RViz and Gazebo take rgba as display values, the loader as linear ones. */
function paintOf(mesh: Mesh): { color: Color; opacity: number } {
  const source = mesh.material as Material & { color: Color };
  const named = mesh.parent !== null && urdfNode(mesh.parent)?.querySelector('material') != null;
  return {
    color: named ? source.color.clone().convertSRGBToLinear() : UNPAINTED,
    opacity: source.opacity > 0 ? source.opacity : 1,
  };
}

function meshUri(visual: Object3D): string {
  return urdfNode(visual)?.querySelector('geometry > mesh')?.getAttribute('filename') ?? '';
}
