import { Color, ShaderLib, type WebGLProgramParametersWithUniforms } from 'three';
import { expect, test } from 'vitest';
import { StaleEffect } from '../../../src/scene/three/stale_effect.ts';

test('every material shares the same uniforms, and the shader has the places they are put', () => {
  const staleEffect = new StaleEffect(new Color());
  const shaders = [1, 2].map(() => {
    const shader = {
      uniforms: {} as Record<string, { value: unknown }>,
      vertexShader: ShaderLib.standard.vertexShader,
      fragmentShader: ShaderLib.standard.fragmentShader,
    };
    staleEffect.patch(shader as unknown as WebGLProgramParametersWithUniforms);
    return shader;
  });
  expect(shaders[0]!.uniforms.drainAmount).toBe(shaders[1]!.uniforms.drainAmount);
  expect(shaders[0]!.fragmentShader).toContain('uniform float drainAmount');
  expect(shaders[0]!.fragmentShader).toContain('if (drainAmount > 0.0)');
});
