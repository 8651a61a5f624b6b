import { Float32BufferAttribute, InstancedBufferGeometry, ShaderMaterial } from 'three';
import { AT, type Strokes } from '../signs/strokes.ts';
import { NumbersMesh } from './numbers_mesh.ts';

/** Segments along a stroke and around it: enough to look round, few enough for dozens of strokes. */
const ALONG = 40;
const AROUND = 8;
/** Drawn after robot and ghost. */
const RENDER_ORDER = 3;
/** Opacity of the second pass, which shows through objects in front. */
const THROUGH = 0.72;

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
        [strokeMaterial(false), RENDER_ORDER],
        [strokeMaterial(true), RENDER_ORDER + 1],
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
    defines: through ? { THROUGH: THROUGH.toFixed(2) } : {},
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
