export interface Paint {
  /** sRGB 0xrrggbb */
  readonly color: number;
  /** 0…1; strokes with less than 1 are drawn after all others. */
  readonly opacity?: number;
  /** Whether it shows through the robot, faintly. */
  readonly through?: boolean;
}

/** The data of a picture, for renderers: rows of numbers, each with one row of attributes. */
export interface DrawnNumbers {
  /** The rows of the newest complete picture, `stride` numbers each. Always the same array. */
  readonly numbers: Float32Array;
  /** The number of rows in it. */
  readonly count: number;
  readonly stride: number;
}

/** Rows of numbers that are rebuilt for each picture. */
export class PictureNumbers implements DrawnNumbers {
  readonly stride: number;
  readonly numbers: Float32Array;
  #count = 0;
  readonly #most: number;
  /** The rows of the picture being built, and their number. */
  protected readonly making: Float32Array;
  protected made = 0;

  /** `most`: further rows are not drawn. */
  constructor(most: number, stride: number) {
    this.#most = most;
    this.stride = stride;
    this.numbers = new Float32Array(most * stride);
    this.making = new Float32Array(most * stride);
  }

  get count(): number {
    return this.#count;
  }

  /** Starts a new picture. */
  begin(): void {
    this.made = 0;
  }

  /** Completes the picture. False if it equals the previous one. */
  end(): boolean {
    const length = this.made * this.stride;
    let changed = this.made !== this.#count;
    for (let i = 0; i < length && !changed; i += 1) changed = this.making[i] !== this.numbers[i];
    if (changed) this.numbers.set(this.making.subarray(0, length));
    this.#count = this.made;
    return changed;
  }

  protected get isFull(): boolean {
    return this.made === this.#most;
  }
}

/** A paint's red, green, blue (sRGB) and opacity, 0…1. */
export function tintOf({ color, opacity = 1 }: Paint): readonly number[] {
  return [(color >> 16) / 255, ((color >> 8) & 255) / 255, (color & 255) / 255, opacity];
}
