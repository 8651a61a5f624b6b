import { Color, type Material, ShaderLib, type WebGLProgramParametersWithUniforms } from 'three';
import { expect, it } from 'vitest';
import { readLod } from '../../../src/model/lod.ts';
import { glass } from '../../../src/scene/three/ghost.ts';
import { declare, insertAfter } from '../../../src/scene/three/shader_text.ts';
import { Bones, Skin } from '../../../src/scene/three/skin.ts';
import { StaleEffect } from '../../../src/scene/three/stale_effect.ts';
import { sampleGlb } from '../../rigs/model_samples.ts';

/** The shader that a material makes of three.js's own. */
function compiled(
  material: Material,
  { vertexShader, fragmentShader }: { vertexShader: string; fragmentShader: string },
) {
  const shader = { uniforms: {}, vertexShader, fragmentShader } as WebGLProgramParametersWithUniforms;
  material.onBeforeCompile(shader, null as never);
  return shader;
}

it('adds bones, paints and the effect of age to the shaders that three.js has', async () => {
  const model = { joints: [], visuals: [{ link: 0 }] };
  const [bones, effect] = [new Bones(1), new StaleEffect(new Color())];
  const tone = { value: new Color() };
  const level = await readLod(await sampleGlb(model), 1);
  const skin = new Skin(level, [], bones, effect, { accent: tone, caution: tone });
  const [material] = [skin.mesh.material].flat();
  const solid = compiled(material!, ShaderLib.standard);
  const ghost = compiled(glass(effect, tone, { value: bones.texture }), ShaderLib.lambert);
  for (const shader of [solid, ghost]) {
    expect(shader.vertexShader).toMatch(/texelFetch\(bones.*#include <skinning_vertex>\ntransformed = /s);
    expect(shader.vertexShader).toMatch(/#include <project_vertex>\s+if \(bone2\.w > 0\.5\) gl_Position/);
    expect(shader.fragmentShader).toMatch(/#include <colorspace_fragment>\s+if \(drainAmount > 0\.0\)/);
  }
  expect(solid.fragmentShader).toMatch(
    /#include <color_fragment>.*paint\.rgb.*#include <emissivemap_fragment>\s+total/s,
  );
  expect(ghost.fragmentShader).toMatch(
    /#include <color_fragment>.*accent.*#include <emissivemap_fragment>\s+float edge/s,
  );
});

it('refuses a shader that has no such place, by its name', () => {
  expect(insertAfter('#include <a>\nx;', 'a', 'y;')).toBe('#include <a>\ny;\nx;');
  expect(declare('void main() {}', 'int a;\n')).toBe('int a;\nvoid main() {}');
  expect(() => insertAfter('void main() {}', 'skinning_vertex', '')).toThrow('#include <skinning_vertex>');
  expect(() => declare('void main(void) {}', '')).toThrow('void main() {');
});
