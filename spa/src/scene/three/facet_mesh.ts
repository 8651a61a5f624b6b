import { Float32BufferAttribute, InstancedBufferGeometry, ShaderMaterial } from 'three';
import type { FacetNumbers } from '../signs/facet_numbers.ts';
import { NumbersMesh } from './numbers_mesh.ts';

/** Drawn after robot and ghost, before all strokes. */
const RENDER_ORDER = 2;
/** Opacity of the second pass, which shows through objects in front. */
const THROUGH = 0.88;

/** Draws all facets in two instanced draw calls, as `OverlayMesh` draws strokes: with depth test, then those marked "through" in
 *  front of everything. They write no depth, so each is drawn over the previous ones. */
export class FacetMesh extends NumbersMesh {
  constructor(facets: FacetNumbers) {
    const { first, second, third, tint, through } = facets.at;
    super(
      facets,
      facetGeometry(),
      { first: [first, 3], second: [second, 3], third: [third, 3], tint: [tint, 4], through: [through, 1] },
      [
        [facetMaterial(false), RENDER_ORDER],
        [facetMaterial(true), RENDER_ORDER + 0.5],
      ],
    );
  }
}

function facetGeometry(): InstancedBufferGeometry {
  const geometry = new InstancedBufferGeometry();
  geometry.setAttribute('corner', new Float32BufferAttribute([0, 1, 2], 1));
  geometry.setIndex([0, 1, 2]);
  return geometry;
}

/** The material of facets. Colours are output as for strokes. */
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
