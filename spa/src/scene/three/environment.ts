import {
  BoxGeometry,
  BufferGeometry,
  Color,
  DirectionalLight,
  Float32BufferAttribute,
  Group,
  HemisphereLight,
  Mesh,
  MeshBasicMaterial,
  PlaneGeometry,
  ShaderMaterial,
  UniformsLib,
  UniformsUtils,
  Vector2,
  Vector4,
} from 'three';
import { type LinkBox, lowestZ } from '../../model/bounds.ts';
import type { PlacedBox } from '../../model/posed_body.ts';
import { fadeOf } from '../camera/framing.ts';
import type { SceneTheme } from './theme.ts';

/** Most links with a contact shadow at a time: two feet, or hands, knees and feet of a crawling robot. */
export const MOST_CONTACTS = 6;
/** Heights in radii of the robot: the shadow falls to 1/e at the first, and is omitted from the second on. */
const FADES_AT = 0.05;
const FORGOTTEN_AT = 0.16;

/**
 * Contact shadows: rounded dark rectangles where a robot is close to the floor. The shadow map is too coarse to show whether a
 * foot touches the floor or hovers; these do.
 */
export class ContactShadow {
  /** For each contact: centre x, y (m), and the direction of the longer side (cosine, sine). */
  readonly place = Array.from({ length: MOST_CONTACTS }, () => new Vector4());
  /** For each contact: half the longer side, half the other (m), and strength: 1 touches the floor, 0 is no contact. */
  readonly size = Array.from({ length: MOST_CONTACTS }, () => new Vector4());

  /** Computes the contacts from the links' boxes. `reach`: the robot's radius, m. */
  follow(boxes: Iterable<PlacedBox>, reach: number): void {
    const near: { z: number; m: ArrayLike<number>; box: LinkBox }[] = [];
    for (const [{ matrixWorld }, box] of boxes) {
      const z = Math.max(0, lowestZ(box, matrixWorld.elements));
      if (z < FORGOTTEN_AT * reach) near.push({ z, m: matrixWorld.elements, box });
    }
    near.sort((a, b) => a.z - b.z);
    for (let i = 0; i < MOST_CONTACTS; i += 1) {
      const found = near[i];
      if (found === undefined) this.size[i]!.set(0, 0, 0, 0);
      else this.#print(i, found.m, found.box, Math.exp(-found.z / (FADES_AT * reach)));
    }
  }

  /** Writes contact i: the rectangle around the box as seen from above. */
  #print(i: number, m: ArrayLike<number>, { min, max }: LinkBox, strength: number): void {
    let [x, y] = [m[12]!, m[13]!];
    let [alongX, alongY, longest] = [1, 0, 0];
    const sides = [0, 1, 2].map((axis) => {
      const half = (max[axis]! - min[axis]!) / 2;
      const middle = (max[axis]! + min[axis]!) / 2;
      const [dx, dy] = [m[axis * 4]!, m[axis * 4 + 1]!];
      x += dx * middle;
      y += dy * middle;
      const flat = Math.hypot(dx, dy);
      if (flat * half > longest) [alongX, alongY, longest] = [dx / flat, dy / flat, flat * half];
      return [dx * half, dy * half] as const;
    });
    const extent = (ex: number, ey: number) =>
      sides.reduce((sum, [dx, dy]) => sum + Math.abs(dx * ex + dy * ey), 0);
    this.place[i]!.set(x, y, alongX, alongY);
    this.size[i]!.set(extent(alongX, alongY), extent(-alongY, alongX), strength, 0);
  }
}

/** Half the floor's side, in radii of the robot: as far as the horizon. */
const FLOOR_REACHES = 60;
/** Pixels along each side of the shadow map at full quality. */
export const SHADOW_PIXELS = 512;
/** x red, y green, z blue, all muted: bright green is used for force arrows. */
const AXIS_COLORS = [0xb3686e, 0x58987b, 0x5e85c3];

/** The surroundings of a robot: lights, floor with grid and shadows, and small axes under the robot. */
export class Environment {
  readonly group = new Group();
  readonly #sky = new HemisphereLight();
  readonly #key = new DirectionalLight();
  readonly #fill = new DirectionalLight();
  readonly #floor: Mesh<PlaneGeometry, ShaderMaterial>;
  readonly #axes = new Mesh(axesGeometry(), new MeshBasicMaterial({ vertexColors: true, toneMapped: false }));
  readonly #contacts = new ContactShadow();
  #reach = 1;
  #flies = 0;

  constructor() {
    this.#sky.position.set(0, 0, 1); // its direction: from the floor to the sky
    this.#key.castShadow = true;
    this.#key.shadow.mapSize.set(SHADOW_PIXELS, SHADOW_PIXELS);
    this.#key.shadow.radius = 5;
    this.#key.shadow.bias = -0.0004;
    this.#key.shadow.normalBias = 0.012;
    this.#floor = new Mesh(new PlaneGeometry(1, 1), floorMaterial());
    this.#floor.material.uniforms.contactPlace!.value = this.#contacts.place;
    this.#floor.material.uniforms.contactSize!.value = this.#contacts.size;
    this.#floor.receiveShadow = true;
    this.#floor.renderOrder = -1;
    this.group.add(
      this.#sky,
      this.#key,
      this.#key.target,
      this.#fill,
      this.#fill.target,
      this.#floor,
      this.#axes,
    );
    this.resize(1);
    this.follow(0, 0, 0);
  }

  setTheme(theme: SceneTheme): void {
    this.#sky.color.copy(theme.sky);
    this.#sky.groundColor.copy(theme.bounce);
    this.#sky.intensity = theme.hemisphere;
    this.#key.intensity = theme.key;
    this.#fill.intensity = theme.fill;
    const uniforms = this.#floor.material.uniforms;
    uniforms.page!.value = theme.page;
    uniforms.floor!.value = theme.floor;
    uniforms.minorLine!.value = theme.minorLine;
    uniforms.majorLine!.value = theme.majorLine;
    uniforms.shadow!.value = theme.shadow;
    uniforms.contact!.value = theme.contact;
  }

  /** Fits lights, floor and axes to a robot of radius `reach` (metres). The grid keeps its pitch of 1 m and 0.1 m. */
  resize(reach: number): void {
    this.#reach = reach;
    const camera = this.#key.shadow.camera;
    camera.left = camera.bottom = -reach * 1.5;
    camera.right = camera.top = reach * 1.5;
    camera.near = reach * 0.5;
    camera.far = reach * 9;
    camera.updateProjectionMatrix();
    this.#key.shadow.normalBias = reach * 0.012;
    this.#floor.material.uniforms.reach!.value = reach;
    this.#axes.scale.setScalar(reach * 0.28);
    this.follow(this.#floor.position.x, this.#floor.position.y, this.#flies);
  }

  /** Updates the contact shadows where links are close to the floor. */
  touch(boxes: Iterable<PlacedBox>): void {
    this.#contacts.follow(boxes, this.#reach);
  }

  /** Moves lights and floor along with a robot at (x, y) at this height above the floor, metres; the grid lines stay where they
   *  are in the world. */
  follow(x: number, y: number, flies: number): void {
    const r = this.#reach;
    const fade = fadeOf(r, flies);
    this.#flies = flies;
    this.#floor.scale.setScalar(fade * FLOOR_REACHES * 2);
    this.#floor.material.uniforms.fade!.value = fade;
    this.#floor.position.set(x, y, 0);
    this.#floor.material.uniforms.focus!.value.set(x, y);
    this.#axes.position.set(x, y, r * 0.002);
    this.#key.target.position.set(x, y, r * 0.5);
    this.#key.position.set(x + r * 2, y + r * 0.7, r * 4.6);
    this.#fill.target.position.set(x, y, r * 0.7);
    this.#fill.position.set(x - r * 0.5, y - r * 3, r * 1.4);
  }

  /** Whether the small axes are drawn. */
  set axesShown(shown: boolean) {
    this.#axes.visible = shown;
  }

  /** Sets the pixels along each side of the shadow map; fewer are cheaper and give softer shadows. */
  set shadowPixels(pixels: number) {
    if (this.#key.shadow.mapSize.x === pixels) return;
    this.#key.shadow.mapSize.set(pixels, pixels);
    this.forgetShadow();
  }

  /** Disposes of the shadow map, for example after a lost context; the next picture makes a new one. */
  forgetShadow(): void {
    this.#key.shadow.dispose();
    this.#key.shadow.map = null;
    this.#key.shadow.mapPass = null;
  }

  dispose(): void {
    this.#floor.geometry.dispose();
    this.#floor.material.dispose();
    this.#axes.geometry.dispose();
    this.#axes.material.dispose();
    this.#key.dispose();
  }
}

/** Three thin bars of length 1 from the origin: x red, y green, z blue. */
function axesGeometry(): BufferGeometry {
  const positions: number[] = [];
  const colors: number[] = [];
  AXIS_COLORS.forEach((hex, axis) => {
    const size: [number, number, number] = [0.035, 0.035, 0.035];
    const centre: [number, number, number] = [0, 0, 0];
    size[axis] = 1;
    centre[axis] = 0.5 + 0.0175;
    const bar = new BoxGeometry(...size).translate(...centre).toNonIndexed();
    const { array, count } = bar.getAttribute('position');
    positions.push(...array);
    for (let i = 0; i < count; i++) colors.push(...new Color(hex).toArray());
  });
  return new BufferGeometry()
    .setAttribute('position', new Float32BufferAttribute(positions, 3))
    .setAttribute('color', new Float32BufferAttribute(colors, 3));
}

/** One material for floor, grid and shadow, so one draw call: the lit area fades to the page's colour, and grid lines
 *  fade sooner. */
function floorMaterial(): ShaderMaterial {
  return new ShaderMaterial({
    lights: true, // for the shadow
    dithering: true, // without it, dark gradients show banding
    uniforms: UniformsUtils.merge([
      UniformsLib.lights,
      {
        page: { value: new Color() },
        floor: { value: new Color() },
        minorLine: { value: new Color() },
        majorLine: { value: new Color() },
        shadow: { value: 0.5 },
        contact: { value: 0.5 },
        contactPlace: { value: [] },
        contactSize: { value: [] },
        reach: { value: 1 },
        fade: { value: 1 },
        focus: { value: new Vector2() },
      },
    ]),
    vertexShader: `
      #include <common>
      #include <shadowmap_pars_vertex>
      varying vec2 place;
      void main() {
        vec3 transformedNormal = normalMatrix * vec3(0.0, 0.0, 1.0);
        vec4 worldPosition = modelMatrix * vec4(position, 1.0);
        place = worldPosition.xy;
        gl_Position = projectionMatrix * viewMatrix * worldPosition;
        #include <shadowmap_vertex>
      }`,
    fragmentShader: `
      #include <common>
      #include <packing>
      #include <dithering_pars_fragment>
      #include <bsdfs>
      #include <lights_pars_begin>
      #include <shadowmap_pars_fragment>
      #include <shadowmask_pars_fragment>
      uniform vec3 page;
      uniform vec3 floor;
      uniform vec3 minorLine;
      uniform vec3 majorLine;
      uniform float shadow;
      uniform float contact;
      uniform vec4 contactPlace[${MOST_CONTACTS}];
      uniform vec4 contactSize[${MOST_CONTACTS}];
      uniform float reach;
      uniform float fade;
      uniform vec2 focus;
      varying vec2 place;

      // How much of a line every \`pitch\` metres covers this pixel; lines nearer than pixels melt away.
      float lines(float pitch) {
        vec2 at = place / pitch;
        vec2 pixel = max(fwidth(at), 1e-6);
        vec2 off = abs(fract(at - 0.5) - 0.5) / pixel;
        vec2 seen = (1.0 - min(off, 1.0)) * (1.0 - smoothstep(0.1, 0.4, pixel));
        return max(seen.x, seen.y);
      }

      // How dark it is under what stands here: full beneath it, gone a hand's breadth beside it.
      float underfoot() {
        float dark = 0.0;
        for (int i = 0; i < ${MOST_CONTACTS}; i++) {
          vec2 off = place - contactPlace[i].xy;
          vec2 along = contactPlace[i].zw;
          vec2 beside = abs(vec2(dot(off, along), dot(off, vec2(-along.y, along.x)))) - contactSize[i].xy * 0.82;
          float far = length(max(beside, 0.0)) / (0.055 * reach);
          dark = max(dark, contactSize[i].z * exp(-far * far));
        }
        return dark;
      }

      void main() {
        float away = length(place - focus) / fade;
        float pool = 1.0 - smoothstep(0.0, 7.0, away);
        vec3 color = mix(page, floor, pool * pool);
        color = mix(color, minorLine, lines(0.1) * (1.0 - smoothstep(0.5, 3.2, away)));
        color = mix(color, majorLine, lines(1.0) * (1.0 - smoothstep(1.0, 9.0, away)));
        color *= 1.0 - shadow * (1.0 - getShadowMask()) * pool;
        color *= 1.0 - contact * underfoot();
        gl_FragColor = vec4(color, 1.0);
        #include <colorspace_fragment>
        #include <dithering_fragment>
      }`,
  });
}
