import type { Color, WebGLProgramParametersWithUniforms } from 'three';

const DRAIN_SECONDS = 0.25;
const HATCH_CSS_PIXELS = 9;

/**
 * Lets the colour drain out of a robot whose pose is old, and hatches it: many robots are grey by themselves, so
 * missing colour alone would say nothing. One uniform for all materials, so that it costs no draw call.
 */
export class StaleEffect {
  readonly #amount = { value: 1 };
  readonly #period = { value: HATCH_CSS_PIXELS };
  readonly #tone: { value: Color };
  #goal = 1;

  constructor(tone: Color) {
    this.#tone = { value: tone };
  }

  get grey(): boolean {
    return this.#goal === 1;
  }

  set grey(grey: boolean) {
    this.#goal = grey ? 1 : 0;
  }

  /** Whether the colours are where they should be. */
  get settled(): boolean {
    return this.#amount.value === this.#goal;
  }

  setTone(tone: Color): void {
    this.#tone.value = tone;
  }

  setPixelRatio(ratio: number): void {
    this.#period.value = HATCH_CSS_PIXELS * ratio;
  }

  /** Moves on by so many seconds (Infinity: at once). True while more ticks are needed. */
  advance(seconds: number): boolean {
    const step = seconds / DRAIN_SECONDS;
    const left = this.#goal - this.#amount.value;
    this.#amount.value = Math.abs(left) <= step ? this.#goal : this.#amount.value + Math.sign(left) * step;
    return this.#amount.value !== this.#goal;
  }

  /** Makes the shader of a material one of those that drain. */
  patch(shader: WebGLProgramParametersWithUniforms): void {
    shader.uniforms.drainAmount = this.#amount;
    shader.uniforms.drainPeriod = this.#period;
    shader.uniforms.drainTone = this.#tone;
    shader.fragmentShader = shader.fragmentShader
      .replace(
        'void main() {',
        'uniform float drainAmount;\nuniform float drainPeriod;\nuniform vec3 drainTone;\nvoid main() {',
      )
      .replace(
        '#include <colorspace_fragment>',
        `#include <colorspace_fragment>
          if (drainAmount > 0.0) {
            float luma = dot(gl_FragColor.rgb, vec3(0.2126, 0.7152, 0.0722));
            float across = abs(fract((gl_FragCoord.x + gl_FragCoord.y) / drainPeriod) - 0.5) * 2.0;
            float hatch = smoothstep(0.62, 0.86, across);
            vec3 old = mix(vec3(luma), drainTone, 0.35) * (0.92 - 0.3 * hatch);
            gl_FragColor.rgb = mix(gl_FragColor.rgb, old, drainAmount);
          }`,
      );
  }
}
