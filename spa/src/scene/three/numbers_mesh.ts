import {
  DynamicDrawUsage,
  Group,
  type InstancedBufferGeometry,
  InstancedInterleavedBuffer,
  InterleavedBufferAttribute,
  Mesh,
  type ShaderMaterial,
} from 'three';
import type { DrawnNumbers } from '../signs/picture_numbers.ts';

/** An attribute's offset among the numbers of a row, and its length. */
type Attributes = Readonly<Record<string, readonly [at: number, size: number]>>;

/** A material, and its render order among transparent objects. */
export type Pass = readonly [material: ShaderMaterial, renderOrder: number];

/** Draws rows of numbers, each as an instance of one geometry: one instanced draw call per pass. */
export class NumbersMesh {
  readonly object = new Group();
  readonly #drawn: DrawnNumbers;
  readonly #buffer: InstancedInterleavedBuffer;
  readonly #geometry: InstancedBufferGeometry;
  readonly #passes: readonly Pass[];

  constructor(
    drawn: DrawnNumbers,
    geometry: InstancedBufferGeometry,
    attributes: Attributes,
    passes: readonly Pass[],
  ) {
    this.#drawn = drawn;
    this.#buffer = new InstancedInterleavedBuffer(drawn.numbers, drawn.stride);
    this.#buffer.setUsage(DynamicDrawUsage);
    this.#geometry = geometry;
    this.#passes = passes;
    for (const [name, [at, size]] of Object.entries(attributes))
      geometry.setAttribute(name, new InterleavedBufferAttribute(this.#buffer, size, at));
    for (const [material, renderOrder] of passes) {
      const mesh = new Mesh(geometry, material);
      mesh.frustumCulled = false;
      mesh.renderOrder = renderOrder;
      this.object.add(mesh);
    }
    this.update();
  }

  /** Uploads the numbers after they have changed. */
  update(): void {
    const { count, stride } = this.#drawn;
    if (count > 0) {
      this.#buffer.clearUpdateRanges();
      this.#buffer.addUpdateRange(0, count * stride);
      this.#buffer.needsUpdate = true;
    }
    this.#geometry.instanceCount = count;
    this.object.visible = count > 0;
  }

  dispose(): void {
    this.object.removeFromParent();
    this.#geometry.dispose();
    for (const [material] of this.#passes) material.dispose();
  }
}
