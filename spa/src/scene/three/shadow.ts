import { InstancedMesh, Matrix4, MeshBasicMaterial, SphereGeometry } from 'three';
import type { PlacedBox } from '../../model/posed_body.ts';

/** Exponent of the superellipsoid, between a ball (2) and a box (∞): round enough for arms, flat enough for soles. */
const SQUARENESS = 4;

/**
 * Casts the robot's shadow with one rounded block for each link's bounding box, all in one draw call. The shadow is soft, so the
 * difference is invisible; casting the meshes themselves would double the cost of a picture.
 */
export class ShadowCaster {
  readonly blocks: InstancedMesh;
  readonly #capacity: number;

  /** `capacity`: the number of links; more boxes than that are not drawn. */
  constructor(capacity: number) {
    this.#capacity = capacity;
    const unseen = new MeshBasicMaterial({ colorWrite: false, depthWrite: false });
    this.blocks = new InstancedMesh(roundedBlock(), unseen, Math.max(1, capacity));
    this.blocks.castShadow = true;
    this.blocks.frustumCulled = false;
    this.blocks.count = 0;
  }

  /** Moves the blocks to the current poses of the links. */
  follow(boxes: Iterable<PlacedBox>): void {
    let count = 0;
    for (const [link, { min, max }] of boxes) {
      if (count === this.#capacity) break;
      LINK_FROM_BLOCK.makeScale(
        (max[0] - min[0]) / 2,
        (max[1] - min[1]) / 2,
        (max[2] - min[2]) / 2,
      ).setPosition((max[0] + min[0]) / 2, (max[1] + min[1]) / 2, (max[2] + min[2]) / 2);
      this.blocks.setMatrixAt(
        count,
        LINK_FROM_BLOCK.premultiply(WORLD_FROM_LINK.fromArray(link.matrixWorld.elements)),
      );
      count += 1;
    }
    this.blocks.count = count;
    this.blocks.instanceMatrix.needsUpdate = true;
  }

  dispose(): void {
    this.blocks.removeFromParent();
    this.blocks.geometry.dispose();
    (this.blocks.material as MeshBasicMaterial).dispose();
    this.blocks.dispose();
  }
}

const LINK_FROM_BLOCK = new Matrix4();
const WORLD_FROM_LINK = new Matrix4();

/** A superellipsoid that fills the cube from -1 to 1. */
function roundedBlock(): SphereGeometry {
  const block = new SphereGeometry(1, 16, 10);
  const position = block.getAttribute('position');
  for (let i = 0; i < position.count; i += 1) {
    const x = position.getX(i);
    const y = position.getY(i);
    const z = position.getZ(i);
    const norm = (x ** SQUARENESS + y ** SQUARENESS + z ** SQUARENESS) ** (1 / SQUARENESS);
    position.setXYZ(i, x / norm, y / norm, z / norm);
  }
  return block;
}
