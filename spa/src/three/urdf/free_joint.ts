import { Matrix4, type Object3D, type Quaternion, Vector3 } from 'three';
import { type Joint, Kinematics } from '../../model/kinematics.ts';

type Triple = readonly [number, number, number];

/** A planar or floating joint of a raw URDF: moves the object that stands for it by its several readings, as a built
 *  model does. */
export class FreeJoint {
  readonly #object: Object3D;
  readonly #kinematics: Kinematics;

  /** The object stands where the joint is at rest. `axis`: of any length but zero; null: x, as the standard says. */
  constructor(object: Object3D, name: string, type: 'planar' | 'floating', axis: Triple | null) {
    this.#object = object;
    const unit = new Vector3(...(axis ?? [1, 0, 0])).normalize().toArray();
    const joint: Joint = {
      name,
      type,
      parent: 0,
      xyz: object.position.toArray(),
      quat: wxyz(object.quaternion),
      axis: unit,
      plane: type === 'planar' ? planeAcross(unit) : null,
      limits: null,
      mimic: null,
    };
    this.#kinematics = new Kinematics([joint]);
  }

  /** What its readings are called: `JOINT/x` … */
  get names(): readonly string[] {
    return this.#kinematics.jointNames;
  }

  /** Takes readings by name, rad or m. False when nothing changed. */
  set(readings: ReadonlyMap<string, number>): boolean {
    if (!this.#kinematics.set(readings)) return false;
    this.#kinematics.compute();
    const { position, quaternion } = this.#object;
    PARENT_FROM_CHILD.fromArray(this.#kinematics.rootFromLink, 16).decompose(position, quaternion, SCALE);
    return true;
  }
}

/** x and y of the plane across a unit axis: the frame's, by the shortest turn that takes z to the axis
 *  (docs/MODEL.md). */
export function planeAcross([a, b, c]: Triple): readonly [Triple, Triple] {
  if (c < -1 + 1e-9)
    return [
      [1, 0, 0],
      [0, -1, 0],
    ]; // every turn by 180° is as short: about x
  const d = 1 / (1 + c);
  return [
    [1 - a * a * d, -a * b * d, -a],
    [-a * b * d, 1 - b * b * d, -b],
  ];
}

const wxyz = ({ w, x, y, z }: Quaternion) => [w, x, y, z] as const;

const PARENT_FROM_CHILD = new Matrix4();
const SCALE = new Vector3();
