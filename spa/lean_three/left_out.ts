import type { KnownMacros } from './shader_text.ts';

/** The version of three.js that these lists are for. For another one: look through them, then change this. */
export const VERSION = '0.187.0';

/*
 * What of three.js the page does without. The scene (`src/three`) draws meshes, instances and lines of five materials in the
 * light of a sky and two suns, with one kind of shadow. three.js can do far more, and its renderer refers to all of it by
 * name, so no bundler leaves it out by itself. Whoever needs one of these in the scene takes it off its list here;
 * `tests/lean_three.test.ts` fails until then.
 */

/** What the scene may import from three.js. Everything below holds only for scenes made of these. */
export const USED_BY_THE_SCENE: readonly string[] = [
  'Box3',
  'BoxGeometry',
  'BufferAttribute',
  'BufferGeometry',
  'Camera',
  'Color',
  'DataTexture',
  'DirectionalLight',
  'DoubleSide',
  'DynamicDrawUsage',
  'Float32BufferAttribute',
  'FloatType',
  'Group',
  'HemisphereLight',
  'InstancedBufferGeometry',
  'InstancedInterleavedBuffer',
  'InstancedMesh',
  'InterleavedBufferAttribute',
  'LineBasicMaterial',
  'LineSegments',
  'MOUSE',
  'Matrix4',
  'Mesh',
  'MeshBasicMaterial',
  'MeshLambertMaterial',
  'MeshStandardMaterial',
  'NearestFilter',
  'NeutralToneMapping',
  'Object3D',
  'PerspectiveCamera',
  'PlaneGeometry',
  'RGBAFormat',
  'Ray',
  'RepeatWrapping',
  'SRGBColorSpace',
  'Scene',
  'ShaderMaterial',
  'SphereGeometry',
  'Texture',
  'UniformsLib',
  'UniformsUtils',
  'VSMShadowMap',
  'Vector2',
  'Vector3',
  'Vector4',
  'WebGLProgramParametersWithUniforms',
  'WebGLRenderer',
];

/** Kinds of things that the scene never makes: the renderer's questions `….isSprite` are answered with false. */
export const KINDS: readonly string[] = [
  ...['isBatchedMesh', 'isSkinnedMesh', 'isSprite', 'isPoints', 'isLOD', 'isLineLoop'],
  ...['isArrayCamera', 'isXRRenderTarget', 'isWebGLCubeRenderTarget', 'isWebGLArrayRenderTarget'],
  ...[
    'isSpriteMaterial',
    'isPointsMaterial',
    'isShadowMaterial',
    'isMeshToonMaterial',
    'isMeshPhongMaterial',
  ],
  ...['isMeshPhysicalMaterial', 'isMeshMatcapMaterial', 'isMeshNormalMaterial', 'isMeshDistanceMaterial'],
  ...['isLineDashedMaterial', 'isNodeMaterial', 'isRawShaderMaterial'],
  ...['isPointLight', 'isSpotLight', 'isRectAreaLight', 'isSunLight', 'isAmbientLight', 'isLightProbe'],
  ...['isLightProbeGrid', 'isFog', 'isFogExp2'],
  ...['isVideoTexture', 'isCompressedTexture', 'isCompressedArrayTexture', 'isCubeTexture'],
  ...[
    'isCompressedCubeTexture',
    'isData3DTexture',
    'isDataArrayTexture',
    'isPMREMTexture',
    'isExternalTexture',
  ],
  ...['isFramebufferTexture', 'isHTMLTexture', 'isGLBufferAttribute'],
];

/** Properties that the scene never sets: the renderer reads what they are by themselves. */
export const PROPERTIES: ReadonlyMap<string, 'null' | 'undefined' | '0'> = new Map([
  ...[
    ...['scene.fog', 'scene.environment', 'scene.overrideMaterial'],
    ...['material.envMap', 'material.aoMap', 'material.lightMap', 'material.bumpMap', 'material.normalMap'],
    ...['material.displacementMap', 'material.emissiveMap', 'material.metalnessMap', 'material.roughnessMap'],
    ...['material.specularMap', 'material.alphaMap'],
  ].map((name) => [name, 'null'] as const),
  // Other materials have these; those of the scene know nothing of them.
  ...[
    ...[
      'material.specularColorMap',
      'material.specularIntensityMap',
      'material.gradientMap',
      'material.matcap',
    ],
    ...['material.anisotropy', 'material.anisotropyMap', 'material.clearcoat', 'material.clearcoatMap'],
    ...['material.clearcoatNormalMap', 'material.clearcoatRoughnessMap', 'material.diffuseRoughness'],
    ...[
      'material.diffuseRoughnessMap',
      'material.dispersion',
      'material.retroreflectivity',
      'material.iridescence',
    ],
    ...[
      'material.iridescenceMap',
      'material.iridescenceThicknessMap',
      'material.sheen',
      'material.sheenColorMap',
    ],
    ...[
      'material.sheenRoughnessMap',
      'material.transmission',
      'material.transmissionMap',
      'material.thicknessMap',
    ],
    ...['material.uniformsGroups', 'geometry.morphAttributes.position', 'geometry.morphAttributes.normal'],
    ...['geometry.morphAttributes.color', 'geometry.attributes.tangent'],
  ].map((name) => [name, 'undefined'] as const),
  ...['material.alphaTest', 'material.alphaHash'].map((name) => [name, '0'] as const),
]);

/** Macros of shaders that follow from the above: never defined, or a number. */
export const MACROS: KnownMacros = new Map<string, number | null>([
  ...[
    ...['USE_BATCHING', 'USE_BATCHING_COLOR', 'USE_SKINNING', 'USE_INSTANCING_MORPH', 'USE_INSTANCING_COLOR'],
    ...[
      'USE_MORPHTARGETS',
      'USE_MORPHNORMALS',
      'USE_MORPHCOLORS',
      'MORPHTARGETS_COUNT',
      'MORPHTARGETS_TEXTURE_STRIDE',
    ],
    ...['USE_FOG', 'FOG_EXP2', 'USE_POINTS_UV', 'USE_SIZEATTENUATION', 'USE_CLIP_DISTANCE', 'USE_TANGENT'],
    ...[
      'USE_ENVMAP',
      'ENVMAP_TYPE_PMREM',
      'ENVMAP_TYPE_CUBE',
      'ENVMAP_MAX_LOD',
      'ENVMAP_SIZE',
      'ENV_WORLDPOS',
    ],
    ...['USE_LIGHTMAP', 'USE_AOMAP', 'USE_BUMPMAP', 'USE_NORMALMAP', 'USE_NORMALMAP_OBJECTSPACE'],
    ...['USE_NORMALMAP_TANGENTSPACE', 'USE_PACKED_NORMALMAP', 'USE_DISPLACEMENTMAP', 'USE_EMISSIVEMAP'],
    ...['USE_SPECULARMAP', 'USE_SPECULAR_COLORMAP', 'USE_SPECULAR_INTENSITYMAP', 'USE_ROUGHNESSMAP'],
    ...[
      'USE_METALNESSMAP',
      'USE_ALPHAMAP',
      'USE_ALPHATEST',
      'USE_ALPHAHASH',
      'USE_GRADIENTMAP',
      'USE_MATCAP',
    ],
    ...[
      'USE_ANISOTROPY',
      'USE_ANISOTROPYMAP',
      'USE_CLEARCOAT',
      'USE_CLEARCOATMAP',
      'USE_CLEARCOAT_ROUGHNESSMAP',
    ],
    ...['USE_CLEARCOAT_NORMALMAP', 'USE_DIFFUSE_ROUGHNESS', 'USE_DIFFUSE_ROUGHNESSMAP', 'USE_DISPERSION'],
    ...[
      'USE_RETROREFLECTION',
      'USE_IRIDESCENCE',
      'USE_IRIDESCENCEMAP',
      'USE_IRIDESCENCE_THICKNESSMAP',
      'USE_SHEEN',
    ],
    ...[
      'USE_SHEEN_COLORMAP',
      'USE_SHEEN_ROUGHNESSMAP',
      'USE_TRANSMISSION',
      'USE_TRANSMISSIONMAP',
      'USE_THICKNESSMAP',
    ],
    ...['USE_LIGHT_PROBES', 'USE_LOGARITHMIC_DEPTH_BUFFER', 'USE_REVERSED_DEPTH_BUFFER', 'ALPHA_TO_COVERAGE'],
    ...[
      'DECODE_VIDEO_TEXTURE',
      'DECODE_VIDEO_TEXTURE_EMISSIVE',
      'DISTANCE',
      'PHYSICAL',
      'PHONG',
      'TOON',
      'IOR',
    ],
    ...['USE_SPECULAR', 'SHADOWMAP_TYPE_PCF', 'SHADOWMAP_TYPE_BASIC'],
  ].map((name) => [name, null] as const),
  ...[
    ...[
      'NUM_SUN_LIGHTS',
      'NUM_POINT_LIGHTS',
      'NUM_SPOT_LIGHTS',
      'NUM_RECT_AREA_LIGHTS',
      'NUM_SPOT_LIGHT_MAPS',
    ],
    ...[
      'NUM_SPOT_LIGHT_COORDS',
      'NUM_SUN_LIGHT_SHADOWS',
      'NUM_POINT_LIGHT_SHADOWS',
      'NUM_SPOT_LIGHT_SHADOWS',
    ],
    ...[
      'NUM_SPOT_LIGHT_SHADOWS_WITH_MAPS',
      'NUM_CLIPPING_PLANES',
      'UNION_CLIPPING_PLANES',
      'NUM_LIGHT_PROBE_GRIDS',
    ],
  ].map((name) => [name, 0] as const),
  ['DEPTH_PACKING', 3200], // as three's shadow map asks for; see MeshDepthMaterial
]);

/** Functions of shaders that three.js names by parts, so that no search finds who calls them. */
export const SHADER_ROOTS: readonly string[] = [
  'main',
  'NeutralToneMapping',
  'LinearToneMapping', // what three.js falls back to
  'sRGBTransferOETF',
  'LinearTransferOETF',
];

/** Methods that nothing here calls on anything: three's own file format, and its search for what a ray meets. */
export const METHODS: readonly string[] = ['toJSON', 'fromJSON', 'raycast'];

/** Members and methods that nothing here calls, by the file that has them. */
export const MEMBERS: Readonly<Record<string, readonly string[]>> = {
  'renderers/shaders/ShaderLib.js': [
    ...[
      'phong',
      'toon',
      'matcap',
      'points',
      'dashed',
      'normal',
      'sprite',
      'background',
      'backgroundCube',
      'cube',
    ],
    ...['equirect', 'distance', 'shadow'],
  ],
  'renderers/WebGLRenderer.js': [
    ...[
      'setEffects',
      'compileAsync',
      'setAnimationLoop',
      'readRenderTargetPixels',
      'readRenderTargetPixelsAsync',
    ],
    ...['copyFramebufferToTexture', 'copyTextureToTexture', 'initRenderTarget', 'initTexture', 'resetState'],
    ...['setRenderTargetTextures', 'setRenderTargetFramebuffer', 'setNodesHandler', 'forceContextRestore'],
  ],
};

/** Modules that stand in for those of three.js whose work never comes up here. What they leave out throws, by name. */
export const STAND_INS: Readonly<Record<string, string>> = {
  // No virtual reality: never presenting, so the renderer asks no more of it.
  'renderers/webxr/WebXRManager.js': `
    export class WebXRManager {
      enabled = false;
      isPresenting = false;
      getEnvironmentBlendMode() {}
      addEventListener() {}
      removeEventListener() {}
      dispose() {}
    }`,
  // No environment maps: the only question is for "none".
  'renderers/webgl/WebGLEnvironments.js': `
    export function WebGLEnvironments() {
      return {
        get(texture) {
          if (texture) throw new Error('left out of three.js: WebGLEnvironments');
          return null;
        },
        dispose() {},
      };
    }`,
  // No uniform blocks.
  'renderers/webgl/WebGLUniformsGroups.js': `
    export function WebGLUniformsGroups() {
      return { dispose() {} };
    }`,
  // No morph targets.
  'renderers/webgl/WebGLMorphtargets.js': `
    export function WebGLMorphtargets() {
      return {
        update() {
          throw new Error('left out of three.js: WebGLMorphtargets');
        },
      };
    }`,
  // No output buffer of other types, no effects after it.
  'renderers/webgl/WebGLOutput.js': `
    export class WebGLOutput {
      constructor() {
        throw new Error('left out of three.js: WebGLOutput');
      }
    }`,
};
