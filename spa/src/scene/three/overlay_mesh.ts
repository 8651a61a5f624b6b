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
import { AT, type DrawnNumbers, FACET_AT, type Facets, type Strokes } from '../signs/strokes.ts';

/** An attribute's offset among the numbers of a row, and its length. */
type Attributes = Readonly<Record<string, readonly [at: number, size: number]>>;

/** A material, and its render order among transparent objects. */
type Pass = readonly [material: ShaderMaterial, renderOrder: number];

/** Draws rows of numbers, each as an instance of one geometry: one instanced draw call per pass. */
class NumbersMesh {
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

/** Drawn after robot and ghost, before all strokes. */
const FACET_ORDER = 2;
/** Opacity of the second pass, which shows through objects in front. */
const FACET_THROUGH = 0.88;

/** Draws all facets in two instanced draw calls, as `OverlayMesh` draws strokes: with depth test, then those marked "through" in
 *  front of everything. They write no depth, so each is drawn over the previous ones. */
export class FacetMesh extends NumbersMesh {
  constructor(facets: Facets) {
    const { first, second, third, tint, through } = FACET_AT;
    super(
      facets,
      facetGeometry(),
      { first: [first, 3], second: [second, 3], third: [third, 3], tint: [tint, 4], through: [through, 1] },
      [
        [facetMaterial(false), FACET_ORDER],
        [facetMaterial(true), FACET_ORDER + 0.5],
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
    defines: through ? { THROUGH: FACET_THROUGH.toFixed(2) } : {},
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

/** Segments along a stroke and around it: enough to look round, few enough for dozens of strokes. */
const ALONG = 40;
const AROUND = 8;
/** Drawn after robot and ghost. */
const STROKE_ORDER = 3;
/** Opacity of the second pass, which shows through objects in front. */
const STROKE_THROUGH = 0.72;

/**
 * Draws all strokes in two instanced draw calls. The first draws them with depth test; the second draws those marked
 * "through" in front of everything, so that for example a force on a sole is not hidden by the leg.
 */
export class OverlayMesh extends NumbersMesh {
  constructor(strokes: Strokes) {
    const { spot, start, axis, shape, manner, tint } = AT;
    super(
      strokes,
      strokeGeometry(),
      {
        ...{ spot: [spot, 3], start: [start, 3], axis: [axis, 3] },
        ...{ shape: [shape, 4], manner: [manner, 2], tint: [tint, 4] },
      },
      [
        [strokeMaterial(false), STROKE_ORDER],
        [strokeMaterial(true), STROKE_ORDER + 1],
      ],
    );
  }
}

/** A stroke's geometry as rings of vertices: (part along it 0…1, angle around it, 0 axis or 1 hull, cap −1, 0 or 1). */
function strokeGeometry(): InstancedBufferGeometry {
  const rings: [along: number, hull: number, cap: number][] = [
    [0, 0, -1],
    [0, 1, -1],
  ];
  for (let i = 0; i <= ALONG; i += 1) rings.push([i / ALONG, 1, 0]);
  rings.push([1, 1, 1], [1, 0, 1]);
  const points = rings.flatMap(([along, hull, cap]) =>
    Array.from({ length: AROUND + 1 }, (_, i) => [along, (i / AROUND) * 2 * Math.PI, hull, cap]).flat(),
  );
  const index: number[] = [];
  for (let ring = 0; ring + 1 < rings.length; ring += 1) {
    if (rings[ring]![2] !== rings[ring + 1]![2]) continue; // no faces between cap and hull
    for (let i = 0; i < AROUND; i += 1) {
      const a = ring * (AROUND + 1) + i;
      const b = a + AROUND + 1;
      index.push(a, a + 1, b, b, a + 1, b + 1);
    }
  }
  const geometry = new InstancedBufferGeometry();
  geometry.setAttribute('place', new Float32BufferAttribute(points, 4));
  geometry.setIndex(index);
  return geometry;
}

/** The material of strokes. Colours are output without tone mapping or conversion, so that they match the page's text.
 *  */
function strokeMaterial(through: boolean): ShaderMaterial {
  return new ShaderMaterial({
    transparent: true,
    toneMapped: false,
    defines: through ? { THROUGH: STROKE_THROUGH.toFixed(2) } : {},
    vertexShader: `
      attribute vec4 place;
      attribute vec3 spot;
      attribute vec3 start;
      attribute vec3 axis;
      attribute vec4 shape;
      attribute vec4 tint;
      attribute vec2 manner;
      varying vec4 paint;
      varying vec3 facing;
      void main() {
        vec3 side = cross(axis, start);
        float radius = mix(shape.z, shape.w, place.x) * place.z;
        float c = cos(place.y);
        float s = sin(place.y);
        vec3 at;
        vec3 outward;
        vec3 onward;
        if (shape.x == 0.0) {
          vec3 around = start * c + side * s;
          at = spot + axis * (place.x * shape.y) + around * radius;
          outward = around * shape.y + axis * (shape.z - shape.w);
          onward = axis;
        } else {
          float angle = place.x * shape.x;
          vec3 away = start * cos(angle) + side * sin(angle);
          at = spot + away * (shape.y + radius * c) + axis * (radius * s * manner.x);
          outward = away * (c * manner.x) + axis * s;
          onward = (side * cos(angle) - start * sin(angle)) * sign(shape.x);
        }
        facing = normalMatrix * (place.w == 0.0 ? outward : onward * place.w);
        paint = tint;
        gl_Position = projectionMatrix * modelViewMatrix * vec4(at, 1.0);
        #ifdef THROUGH
          paint.a *= THROUGH;
          // Before everything else, and in order among themselves.
          gl_Position.z = -gl_Position.w + (gl_Position.z + gl_Position.w) * 0.01;
          if (manner.y == 0.0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
        #endif
      }`,
    fragmentShader: `
      varying vec4 paint;
      varying vec3 facing;
      void main() {
        float lit = dot(normalize(facing), normalize(vec3(-0.35, 0.65, 0.7)));
        float light = paint.a < 1.0 && !gl_FrontFacing ? 1.0 : 0.9 + 0.12 * lit;
        gl_FragColor = vec4(min(paint.rgb * light, 1.0), paint.a);
      }`,
  });
}
