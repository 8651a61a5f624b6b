import type { Color, WebGLProgramParametersWithUniforms } from 'three';
import { declare, insertAfter } from './shader_text.ts';

const HATCH_CSS_PIXELS = 9;

const DRAIN = `
if (drainAmount > 0.0) {
  float luma = dot(gl_FragColor.rgb, vec3(0.2126, 0.7152, 0.0722));
  float across = abs(fract((gl_FragCoord.x + gl_FragCoord.y) / drainPeriod) - 0.5) * 2.0;
  float hatch = smoothstep(0.62, 0.86, across);
  vec3 old = mix(vec3(luma), drainTone, 0.35) * (0.92 - 0.3 * hatch);
  gl_FragColor.rgb = mix(gl_FragColor.rgb, old, drainAmount);
}
`;

/**
 * Greys and hatches a robot whose pose is old; many robots are grey anyway, so missing colour alone would mean nothing. It is a
 * uniform shared by all of the robot's materials, so it costs no draw call.
 */
export class StaleEffect {
  readonly #amount = { value: 1 };
  readonly #period = { value: HATCH_CSS_PIXELS };
  readonly #tone: { value: Color };

  constructor(tone: Color) {
    this.#tone = { value: tone };
  }

  /** How far the robot has faded to grey, 0…1. */
  set amount(amount: number) {
    this.#amount.value = amount;
  }

  setTone(tone: Color): void {
    this.#tone.value = tone;
  }

  setPixelRatio(ratio: number): void {
    this.#period.value = HATCH_CSS_PIXELS * ratio;
  }

  /** Adds the effect to a material's shader; call it in `onBeforeCompile`. */
  patch(shader: WebGLProgramParametersWithUniforms): void {
    shader.uniforms.drainAmount = this.#amount;
    shader.uniforms.drainPeriod = this.#period;
    shader.uniforms.drainTone = this.#tone;
    const head = 'uniform float drainAmount;\nuniform float drainPeriod;\nuniform vec3 drainTone;\n';
    shader.fragmentShader = insertAfter(declare(shader.fragmentShader, head), 'colorspace_fragment', DRAIN);
  }
}
