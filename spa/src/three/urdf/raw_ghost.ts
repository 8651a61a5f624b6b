import { type BufferGeometry, type Material, type Matrix4, Mesh, type Object3D } from 'three';
import type { URDFRobot } from 'urdf-loader';
import type { LinkLook } from '../../model/posed_body.ts';
import type { FigureGhost } from '../robot/figure.ts';
import { GLASS_ORDER } from '../robot/glass.ts';
import { UrdfJoints } from './joints.ts';

/** A second body of a robot from raw files: links and joints of its own, the very geometries of the first, one draw call
 *  for each mesh. */
export class RawGhost implements FigureGhost {
  /** Hangs below the robot's root. */
  readonly root: Object3D;
  readonly #robot: URDFRobot;
  readonly #joints: UrdfJoints;
  readonly #glass: Material;
  readonly #onGone: (ghost: RawGhost) => void;
  readonly #meshes = new Map<string, Mesh[]>();
  readonly #hidden = new Set<string>();

  /** `robot`: the same one read anew, without anything to be seen. `glass` and geometries are lent. */
  constructor(robot: URDFRobot, glass: Material, onGone: (ghost: RawGhost) => void) {
    this.#robot = robot;
    this.root = robot;
    this.#joints = new UrdfJoints(robot);
    this.#glass = glass;
    this.#onGone = onGone;
  }

  /** Puts on a mesh of the body's. */
  wear(link: string, geometry: BufferGeometry, linkFromMesh: Matrix4): void {
    const mesh = new Mesh(geometry, this.#glass);
    mesh.matrixAutoUpdate = false;
    mesh.matrix.copy(linkFromMesh);
    mesh.renderOrder = GLASS_ORDER;
    mesh.raycast = () => {}; // one points at the body
    mesh.visible = !this.#hidden.has(link);
    this.#meshes.set(link, [...(this.#meshes.get(link) ?? []), mesh]);
    this.#robot.links[link]?.add(mesh);
  }

  setJoints(joints: ReadonlyMap<string, number>): boolean {
    return this.#joints.set(joints);
  }

  setLook(link: string, { hide = false }: LinkLook): void {
    if (hide) this.#hidden.add(link);
    else this.#hidden.delete(link);
    for (const mesh of this.#meshes.get(link) ?? []) mesh.visible = !hide;
  }

  dispose(): void {
    this.root.removeFromParent();
    this.#onGone(this);
  }
}
