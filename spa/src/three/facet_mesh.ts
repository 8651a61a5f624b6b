import {
  DynamicDrawUsage,
  Float32BufferAttribute,
  Group,
  InstancedBufferGeometry,
  InstancedInterleavedBuffer,
  InterleavedBufferAttribute,
  Mesh,
  ShaderMaterial,
} from 'three';
import type { FacetLayout, FacetNumbers } from '../overlays/facet_numbers.ts';

/** Drawn after robot and ghost, before all strokes. */
const RENDER_ORDER = 2;
/** Opacity of the second pass, which shows through what is in front. */
const THROUGH = 0.88;

const SIZES: Readonly<Record<keyof FacetLayout, number>> = {
  ...{ first: 3, second: 3, third: 3, tint: 4, through: 1 },
};

/** Draws all facets in two instanced draw calls, as `OverlayMesh` draws strokes: with depth test, then those marked
 *  "through" in front of everything. They write no depth, so each lies over those before it. */
export class FacetMesh {
  readonly object = new Group();
  readonly #facets: FacetNumbers;
  readonly #buffer: InstancedInterleavedBuffer;
  readonly #geometry = new InstancedBufferGeometry();
  readonly #materials = [facetMaterial(false), facetMaterial(true)] as const;

  constructor(facets: FacetNumbers) {
    this.#facets = facets;
    this.#buffer = new InstancedInterleavedBuffer(facets.numbers, facets.stride);
    this.#buffer.setUsage(DynamicDrawUsage);
    this.#geometry.setAttribute('corner', new Float32BufferAttribute([0, 1, 2], 1));
    this.#geometry.setIndex([0, 1, 2]);
    for (const [name, at] of Object.entries(facets.at)) {
      const size = SIZES[name as keyof FacetLayout];
      this.#geometry.setAttribute(name, new InterleavedBufferAttribute(this.#buffer, size, at));
    }
    this.#materials.forEach((material, i) => {
      const mesh = new Mesh(this.#geometry, material);
      mesh.frustumCulled = false;
      mesh.renderOrder = RENDER_ORDER + i / 2;
      this.object.add(mesh);
    });
    this.update();
  }

  /** Uploads the facets after they have changed. */
  update(): void {
    const { count, stride } = this.#facets;
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
    for (const material of this.#materials) material.dispose();
  }
}

/** The material of facets. Colours are output as those of strokes are. */
function facetMaterial(through: boolean): ShaderMaterial {
  return new ShaderMaterial({
    transparent: true,
    depthWrite: false,
    toneMapped: false,
    defines: through ? { THROUGH: THROUGH.toFixed(2) } : {},
    vertexShader: `
      attribute float corner;
      attribute vec3 first;
      attribute vec3 second;
      attribute vec3 third;
      attribute vec4 tint;
      attribute float through;
      varying vec4 paint;
      void main() {
        vec3 facing = normalize(normalMatrix * cross(second - first, third - first));
        paint = vec4(tint.rgb * (0.9 + 0.12 * dot(facing, normalize(vec3(-0.35, 0.65, 0.7)))), tint.a);
        vec3 at = corner < 0.5 ? first : corner < 1.5 ? second : third;
        gl_Position = projectionMatrix * modelViewMatrix * vec4(at, 1.0);
        #ifdef THROUGH
          paint.a *= THROUGH;
          gl_Position.z = -gl_Position.w + (gl_Position.z + gl_Position.w) * 0.01; // before everything else
          if (through == 0.0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
        #endif
      }`,
    fragmentShader: `
      varying vec4 paint;
      void main() {
        gl_FragColor = vec4(min(paint.rgb, 1.0), paint.a);
      }`,
  });
}
