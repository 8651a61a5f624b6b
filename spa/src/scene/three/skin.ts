import {
  BufferAttribute,
  BufferGeometry,
  type Color,
  DataTexture,
  DoubleSide,
  FloatType,
  Mesh,
  MeshStandardMaterial,
  NearestFilter,
  RepeatWrapping,
  RGBAFormat,
  SRGBColorSpace,
  Texture,
  type WebGLProgramParametersWithUniforms,
} from 'three';
import { multiply } from '../../model/kinematics.ts';
import type { Lod } from '../../model/lod.ts';
import type { LinkLook, LinkTint } from '../../model/posed_body.ts';
import { declare, insertAfter } from './shader_text.ts';
import type { StaleEffect } from './stale_effect.ts';

const ROUGHNESS = 0.6;
const NUMBERS = 16;

/**
 * The bones of one robot as a GPU texture of 4 × n texels: root_from_mesh of each visual, column by column. The bottom row of
 * these matrices is constant, so it holds the visual's display options instead: highlight, fade, hide, and tint (0 for none, else
 * 1 + 0xrrggbb, negative when hatched). One upload moves and paints the whole robot. A ghost has its own bones.
 */
export class Bones {
  readonly texture: DataTexture;
  readonly #numbers: Float32Array;

  constructor(visuals: number) {
    this.#numbers = new Float32Array(Math.max(1, visuals) * NUMBERS);
    this.texture = new DataTexture(this.#numbers, 4, Math.max(1, visuals), RGBAFormat, FloatType);
    this.texture.minFilter = this.texture.magFilter = NearestFilter;
    this.texture.needsUpdate = true;
  }

  /** Moves every visual with its link. Transforms have 16 numbers each, column-major. */
  follow(rootFromLink: Float64Array, linkOfVisual: ArrayLike<number>, linkFromMesh: Float64Array): void {
    const bones = this.#numbers;
    for (let i = 0; i < linkOfVisual.length; i += 1) {
      const at = i * NUMBERS;
      const highlight = bones[at + 3]!;
      const fade = bones[at + 7]!;
      const hide = bones[at + 11]!;
      const tint = bones[at + 15]!;
      multiply(bones, at, rootFromLink, linkOfVisual[i]! * NUMBERS, linkFromMesh, at);
      bones[at + 3] = highlight;
      bones[at + 7] = fade;
      bones[at + 11] = hide;
      bones[at + 15] = tint;
    }
    this.texture.needsUpdate = true;
  }

  setLook(visual: number, { highlight = 0, fade = 0, hide = false }: LinkLook): void {
    const at = visual * NUMBERS;
    this.#numbers[at + 3] = highlight;
    this.#numbers[at + 7] = fade;
    this.#numbers[at + 11] = hide ? 1 : 0;
    this.texture.needsUpdate = true;
  }

  setTint(visual: number, tint: LinkTint | null): void {
    const packed = tint === null ? 0 : (tint.hatched ? -1 : 1) * (1 + tint.color);
    const at = visual * NUMBERS + 15;
    if (this.#numbers[at] === packed) return;
    this.#numbers[at] = packed;
    this.texture.needsUpdate = true;
  }

  isHidden(visual: number): boolean {
    return this.#numbers[visual * NUMBERS + 11]! > 0.5;
  }

  dispose(): void {
    this.texture.dispose();
  }
}

/** The geometry of a level, which a skin and its ghosts share. */
export function skinGeometry(level: Lod): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(level.positions, 4));
  geometry.setAttribute('normal', new BufferAttribute(level.normals, 4, true));
  geometry.setAttribute('part', new BufferAttribute(level.parts, 2));
  if (level.uvs !== null) geometry.setAttribute('uv', new BufferAttribute(level.uvs, 2));
  geometry.setIndex(new BufferAttribute(level.index, 1));
  if (level.draws.length > 1) {
    level.draws.forEach(({ start, count }, i) => {
      geometry.addGroup(start, count, i);
    });
  }
  return geometry;
}

/**
 * Draws a level by rigid skinning with one bone per vertex: one draw call for everything untextured and one for each texture.
 * SkinnedMesh of three.js would mix four bones per vertex and need an Object3D for each bone.
 */
export class Skin {
  readonly mesh: Mesh<BufferGeometry, MeshStandardMaterial | MeshStandardMaterial[]>;
  readonly #materials: readonly MeshStandardMaterial[];
  readonly #paints: DataTexture;

  /** `pictures`: the level's textures in its order; null for one that could not be read. */
  constructor(
    level: Lod,
    pictures: readonly (ImageBitmap | null)[],
    bones: Bones,
    staleEffect: StaleEffect,
    tones: SkinTones,
  ) {
    this.#paints = new DataTexture(level.paints, level.paints.length / 4, 1, RGBAFormat, FloatType);
    this.#paints.minFilter = this.#paints.magFilter = NearestFilter;
    this.#paints.needsUpdate = true;
    const paints = this.#paints;
    const seeThrough = level.paints.some((part, i) => i % 4 === 3 && part < 1);
    const draws = level.draws.length > 0 ? level.draws : [{ start: 0, count: 0, picture: null }];
    this.#materials = draws.map(({ picture }) => {
      const material = new MeshStandardMaterial({ roughness: ROUGHNESS, metalness: 0, side: DoubleSide });
      const image = picture === null ? null : (pictures[picture] ?? null);
      if (image !== null) material.map = pictureTexture(image);
      if (seeThrough) material.defines = { ...material.defines, SEE_THROUGH: '' };
      material.onBeforeCompile = (shader) => {
        staleEffect.patch(shader);
        patch(shader, { bones: { value: bones.texture }, paints: { value: paints }, ...tones });
      };
      material.customProgramCacheKey = () => 'skin';
      return material;
    });
    const [first] = this.#materials;
    const geometry = skinGeometry(level);
    this.mesh = new Mesh(geometry, level.draws.length > 1 ? [...this.#materials] : first!);
    this.mesh.frustumCulled = false; // its bounds change with every pose, and it is nearly always in view
  }

  /** Lets the shader discard fragments, for links that fade. Off until needed, because `discard` slows the GPU down. */
  allowFading(): void {
    for (const material of this.#materials) {
      if (material.defines?.SEE_THROUGH !== undefined) continue;
      material.defines = { ...material.defines, SEE_THROUGH: '' };
      material.needsUpdate = true;
    }
  }

  dispose(): void {
    this.mesh.removeFromParent();
    this.mesh.geometry.dispose();
    this.#paints.dispose();
    for (const material of this.#materials) {
      material.map?.dispose();
      material.dispose();
    }
  }
}

/** Colours of the theme, as uniforms. */
export interface SkinTones {
  readonly accent: { value: Color };
  readonly caution: { value: Color };
}

function pictureTexture(picture: ImageBitmap): Texture {
  const texture = new Texture(picture);
  texture.colorSpace = SRGBColorSpace;
  texture.flipY = false; // glTF's origin of v
  texture.wrapS = texture.wrapT = RepeatWrapping;
  texture.needsUpdate = true;
  return texture;
}

type Uniforms = SkinTones & {
  readonly bones: { value: DataTexture };
  readonly paints: { value: DataTexture };
};

const VERTEX_HEAD = `
attribute vec2 part;
uniform highp sampler2D bones;
flat varying vec2 look;
`;

const PAINT_HEAD = `
uniform highp sampler2D paints;
flat varying vec4 paint;
flat varying vec4 tint;
`;

/** Rotates the normal with its link. Scales are uniform, so no inverse transpose is needed. */
const BONE_NORMAL = `
int bone = int(part.x + 0.5);
vec4 bone0 = texelFetch(bones, ivec2(0, bone), 0);
vec4 bone1 = texelFetch(bones, ivec2(1, bone), 0);
vec4 bone2 = texelFetch(bones, ivec2(2, bone), 0);
vec4 bone3 = texelFetch(bones, ivec2(3, bone), 0);
look = vec2(bone0.w, bone1.w);
objectNormal = normalize(mat3(bone0.xyz, bone1.xyz, bone2.xyz) * objectNormal);
`;

const VERTEX_PAINT = `
paint = texelFetch(paints, ivec2(int(part.y + 0.5), 0), 0);
tint = vec4(0.0);
if (bone3.w != 0.0) {
  int packed = int(abs(bone3.w)) - 1;
  tint = vec4(vec3(packed >> 16, (packed >> 8) & 255, packed & 255) / 255.0, bone3.w < 0.0 ? 2.0 : 1.0);
  tint.rgb = pow(tint.rgb, vec3(2.2));
}
`;

const BONE_POSITION = 'transformed = mat3(bone0.xyz, bone1.xyz, bone2.xyz) * vec3(position) + bone3.xyz;\n';

/** Moves all vertices of a hidden link to one point outside the picture, so that none of it is rasterised. */
const BONE_HIDE = '\nif (bone2.w > 0.5) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);\n';

const FRAGMENT_HEAD = `
uniform vec3 accent;
uniform vec3 caution;
flat varying vec4 paint;
flat varying vec4 tint;
flat varying vec2 look;

#ifdef SEE_THROUGH
// An ordered 4 × 4 dither pattern: objects behind show through without sorting and without a second draw call.
float threshold(vec2 at) {
  ivec2 cell = ivec2(at) & 3;
  int bits = ((cell.x ^ cell.y) & 1) * 8 + (cell.y & 1) * 4 + (((cell.x ^ cell.y) >> 1) & 1) * 2 + ((cell.y >> 1) & 1);
  return (float(bits) + 0.5) / 16.0;
}
#endif
`;

const PAINT = `
#ifdef SEE_THROUGH
if (min(paint.a, 1.0) * (1.0 - look.y) < threshold(gl_FragCoord.xy)) discard;
#endif
diffuseColor.rgb *= paint.rgb;
if (paint.a > 1.5) {
  float across = abs(fract((gl_FragCoord.x - gl_FragCoord.y) / 12.0) - 0.5) * 2.0;
  diffuseColor.rgb = mix(mix(vec3(0.3), caution, 0.12), caution, smoothstep(0.66, 0.84, across));
}
if (tint.a > 0.5) {
  diffuseColor.rgb = tint.rgb;
  if (tint.a > 1.5) {
    float across = abs(fract((gl_FragCoord.x - gl_FragCoord.y) / 14.0) - 0.5) * 2.0;
    diffuseColor.rgb *= mix(1.0, 0.35, smoothstep(0.5, 0.7, across));
  }
}
`;

const GLOW = `
totalEmissiveRadiance += accent * look.x * 0.55;
diffuseColor.rgb = mix(diffuseColor.rgb, accent, look.x * 0.35);
`;

function patch(shader: WebGLProgramParametersWithUniforms, uniforms: Uniforms): void {
  Object.assign(shader.uniforms, uniforms);
  injectSkinning(shader, VERTEX_HEAD + PAINT_HEAD, BONE_NORMAL + VERTEX_PAINT);
  const painted = insertAfter(declare(shader.fragmentShader, FRAGMENT_HEAD), 'color_fragment', PAINT);
  shader.fragmentShader = insertAfter(painted, 'emissivemap_fragment', GLOW);
}

/** Makes a shader's vertices follow their bones. `head` declares attributes, uniforms and varyings. */
export function injectSkinning(
  shader: WebGLProgramParametersWithUniforms,
  head: string,
  normal = BONE_NORMAL,
): void {
  const turned = insertAfter(declare(shader.vertexShader, head), 'skinbase_vertex', normal);
  const moved = insertAfter(turned, 'skinning_vertex', BONE_POSITION);
  shader.vertexShader = insertAfter(moved, 'project_vertex', BONE_HIDE);
}
