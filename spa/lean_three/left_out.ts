import type { KnownMacros } from './shader_text.ts';

/** The version of three.js that these lists are for. Before changing it, review the lists. */
export const VERSION = '0.187.0';

/*
 * The parts of three.js that the page leaves out. The scene (`src/three`) draws meshes, instances and lines with five materials,
 * lit by a sky and two suns, with one kind of shadow. three.js can do far more, and its renderer refers to all of it by name, so
 * bundlers can't remove it automatically. If the scene needs one of these, remove it from its list here;
 * `tests/lean_three.test.ts` fails until then.
 */

/** What the scene may import from three.js. Everything below is valid only for scenes made of these. */
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

/** Kinds of objects that the scene never creates: the renderer's checks `….isSprite` are replaced by false. */
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

/** Properties that the scene never sets: the renderer sees their default values. */
export const PROPERTIES: ReadonlyMap<string, 'null' | 'undefined' | '0'> = new Map([
  ...[
    ...['scene.fog', 'scene.environment', 'scene.overrideMaterial'],
    ...['material.envMap', 'material.aoMap', 'material.lightMap', 'material.bumpMap', 'material.normalMap'],
    ...['material.displacementMap', 'material.emissiveMap', 'material.metalnessMap', 'material.roughnessMap'],
    ...['material.specularMap', 'material.alphaMap'],
  ].map((name) => [name, 'null'] as const),
  // Other materials have these; the scene's materials don't.
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

/** Shader macros that follow from the above: never defined, or a number. */
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
  ['DEPTH_PACKING', 3200], // required by three's shadow map; see MeshDepthMaterial
]);

/** Shader functions whose names three.js assembles from parts, so that no search finds their callers. */
export const SHADER_ROOTS: readonly string[] = [
  'main',
  'NeutralToneMapping',
  'LinearToneMapping', // three.js's fallback
  'sRGBTransferOETF',
  'LinearTransferOETF',
];

/** Methods that nothing here calls: three's own file format, and its raycasting. */
export const METHODS: readonly string[] = ['toJSON', 'fromJSON', 'raycast'];

/** Members and methods that nothing here calls, by file. */
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

/** Replacements for three.js modules whose features are never used here. Omitted functions throw, by name. */
export const STAND_INS: Readonly<Record<string, string>> = {
  // No virtual reality: never presenting, so the renderer asks for nothing more.
  'renderers/webxr/WebXRManager.js': `
    export class WebXRManager {
      enabled = false;
      isPresenting = false;
      getEnvironmentBlendMode() {}
      addEventListener() {}
      removeEventListener() {}
      dispose() {}
    }`,
  // No environment maps: the only query is for "none".
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
  // No output buffers of other types, no post-processing.
  'renderers/webgl/WebGLOutput.js': `
    export class WebGLOutput {
      constructor() {
        throw new Error('left out of three.js: WebGLOutput');
      }
    }`,
};
