import type { Schema } from '@posecast/wire';
import { Attitude } from './attitude.ts';
import { Balance } from './balance.ts';
import { Deviations } from './deviations.ts';
import { Forces } from './forces.ts';
import { Load } from './load.ts';
import {
  isSwitchedOn,
  type Sign,
  type SignFrame,
  type SignGhost,
  type SignKind,
  type SignLabel,
  type SignPicture,
} from './sign.ts';

/** All signs, in the order of menu and labels. They are drawn from the last to the first: `Balance` tells those before it where it
 *  marks feet and support. The place of any other matters only for what it covers. */
export const SIGNS: readonly SignKind[] = [Forces, Attitude, Deviations, Balance, Load];

/** The signs of one robot: reads them, and draws those that are on. */
export class RobotSigns {
  readonly #kinds: readonly SignKind[];
  /** null while there is nothing to show. */
  frame: SignFrame | null = null;
  #schema: Schema | null = null;
  /** Those that are on, in the order of the menu. */
  #on: readonly Sign[] = [];
  #signs: { readonly kind: SignKind; readonly can: boolean; sign: Sign; on: boolean }[] = [];

  constructor(kinds: readonly SignKind[] = SIGNS) {
    this.#kinds = kinds;
  }

  /** What each sign has drawn, by key, for tests and the debug interface. */
  get drawn(): Readonly<Record<string, unknown>> {
    return Object.fromEntries(this.#signs.map(({ kind, sign }) => [kind.key, sign.drawn]));
  }

  /** The ghost that a sign wants; null for none. */
  get ghost(): SignGhost | null {
    return this.#on.find(({ ghost }) => ghost != null)?.ghost ?? null;
  }

  /** The sign of a kind; null while it is off. */
  of<S extends Sign>(kind: SignKind<S>): S | null {
    const found = this.#signs.find((one) => one.kind === kind);
    return found !== undefined && this.#on.includes(found.sign) ? (found.sign as S) : null;
  }

  /** Takes the newest frame; null: there is nothing to show. */
  read(frame: SignFrame | null): void {
    this.frame = frame;
    this.#on = [];
    if (frame === null) {
      this.#schema = null;
      this.#signs = []; // they forget what they have drawn
      return;
    }
    const { schema, settings } = frame;
    if (schema !== this.#schema) {
      this.#schema = schema;
      this.#signs = this.#kinds.map((kind) => ({
        kind,
        can: kind.can(schema),
        sign: new kind(schema),
        on: false,
      }));
    }
    for (const one of this.#signs) {
      const { kind, can } = one;
      const on = can && (kind.shown?.(settings) ?? isSwitchedOn(kind, settings));
      if (one.on && !on) one.sign = new kind(schema); // it forgets what it has drawn
      one.on = on;
    }
    this.#on = this.#signs.flatMap(({ sign, on }) => (on ? [sign] : []));
    for (const sign of this.#on) sign.read(frame);
  }

  /** Advances the easing of arrows. True while it continues. */
  advance(seconds: number): boolean {
    let moving = false;
    for (const sign of this.#on) moving = sign.advance?.(seconds) || moving;
    return moving;
  }

  draw(picture: SignPicture): void {
    for (let i = this.#on.length - 1; i >= 0; i -= 1) this.#on[i]!.draw(picture);
  }

  /** The labels for the newest `draw`. */
  labels(picture: SignPicture): SignLabel[] {
    return this.#on.flatMap((sign) => sign.labels?.(picture) ?? []);
  }
}
