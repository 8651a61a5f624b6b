import type { Object3D } from 'three';
import {
  type Box3,
  BufferAttribute,
  BufferGeometry,
  Color,
  type Material,
  Matrix4,
  Mesh,
  type Ray,
  Raycaster,
  Vector3,
} from 'three';
import URDFLoader, { type URDFJoint, type URDFRobot } from 'urdf-loader';
import type { Figure } from './figure.ts';
import { emptyBox, growBox, type LinkBox, lowestZ } from './grounding.ts';
import type { MeshPart } from './mesh_loader.ts';
import type { Palette } from './palette.ts';
import type { LinkLook } from './skin.ts';
import { readUrdf } from './urdf_document.ts';
import type { Welded } from './weld.ts';

/** The shade of a shell for which neither URDF nor mesh names one. */
const UNPAINTED = new Color(0xc4cad3);
const SLIDES_OR_TURNS = new Set(['revolute', 'continuous', 'prismatic']);

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
export class RobotModel implements Figure {
  readonly root: Object3D;
  readonly problems: readonly string[];
  readonly slots: readonly MeshSlot[];
  readonly #robot: URDFRobot;
  readonly #palette: Palette;
  readonly #joints: readonly URDFJoint[];
  /** The newest reading of each joint; NaN until there is one. A joint without a reading keeps its place. */
  readonly #angles: Float64Array;
  /** For each link that shows something, its bounding box. */
  readonly boxes: ReadonlyMap<Object3D, LinkBox>;
  readonly #boxes = new Map<Object3D, LinkBox>();
  readonly #owned = new Set<BufferGeometry>();
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
    const joints = Object.values(this.#robot.joints).filter((joint) => SLIDES_OR_TURNS.has(joint.jointType));
    // A joint that mimics another comes last: where the robot reports it, its own reading wins.
    this.#joints = joints.sort((a, b) => Number('mimicJoint' in a) - Number('mimicJoint' in b));
    this.#angles = new Float64Array(this.#joints.length).fill(Number.NaN);
    for (const joint of this.#joints) {
      joint.ignoreLimits = true; // a monitor shows what is, also where it should not be
      if (!('mimicJoint' in joint)) joint.setJointValue(0); // followers take their offsets
    }
    this.#finishPrimitives(new Set(slots));
    this.slots = slots.map((mesh) => this.#slot(mesh));
  }

  get jointNames(): string[] {
    return this.#joints.map((joint) => joint.name);
  }

  get linkNames(): string[] {
    return Object.keys(this.#robot.links);
  }

  /** world_from_link of the newest `place`, column-major. */
  linkMatrix(name: string): Matrix4 | undefined {
    return this.#robot.links[name]?.matrixWorld;
  }

  /** For each link but the root: its parent link's name and its own. */
  *bones(): Generator<[parent: string, child: string]> {
    for (const [child, link] of Object.entries(this.#robot.links)) {
      const parent = link.parent?.parent;
      if (parent !== null && parent !== undefined) yield [parent.name, child];
    }
  }

  /** Turns the joints; rad or m by URDF name. False when nothing changed: then there is nothing to draw. */
  setJoints(joints: ReadonlyMap<string, number>): boolean {
    let changed = false;
    for (const [i, joint] of this.#joints.entries()) {
      const angle = joints.get(joint.name);
      if (angle === undefined || !Number.isFinite(angle) || angle === this.#angles[i]) continue;
      this.#angles[i] = angle;
      changed = true;
    }
    if (!changed) return false;
    for (const [i, joint] of this.#joints.entries()) {
      const angle = this.#angles[i]!;
      if (!Number.isNaN(angle)) joint.setJointValue(angle);
    }
    return true;
  }

  /** Puts the root link at a place in the world and computes every link's matrix. */
  place(xyz: readonly [number, number, number], quat_wxyz: readonly [number, number, number, number]): void {
    const [w, x, y, z] = quat_wxyz;
    this.root.position.set(...xyz);
    this.root.quaternion.set(x, y, z, w).normalize();
    this.root.updateMatrixWorld(true);
  }

  /** Stands the robot upright at the world's origin, its lowest point on the floor. */
  ground(): void {
    this.place([0, 0, 0], [1, 0, 0, 0]);
    const low = this.#lowest();
    if (low !== 0) this.place([0, 0, -low], [1, 0, 0, 0]);
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

  dispose(): void {
    this.root.removeFromParent();
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
const RAYCASTER = new Raycaster();
const LINK_FROM_MESH = new Matrix4();

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
