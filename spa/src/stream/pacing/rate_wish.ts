/** Least time between two rate requests, so that a person flipping through tabs does not flood the relay. */
const RATE_EVERY_MS = 500;
/** The same on server-sent events, where every other rate needs a new connection. */
const REASK_EVERY_MS = 2000;

/** The frame rate that a viewer wishes for, and the one that it has asked for. */
export class RateWish {
  /** While somebody looks and the network is fine. */
  readonly wantedHz: number;
  /** A hidden page asks for no poses at all. */
  visible: boolean;
  /** Lowered rate for a slow network, on events only; null: the full rate. */
  slowHz: number | null = null;
  /** The rate asked for on the newest connection; NaN: it is to be asked for again. */
  askedHz: number;
  #askedMs = Number.NEGATIVE_INFINITY;

  constructor(wantedHz: number, visible: boolean) {
    this.wantedHz = wantedHz;
    this.visible = visible;
    this.askedHz = wantedHz;
  }

  get hz(): number {
    return this.visible ? (this.slowHz ?? this.wantedHz) : 0;
  }

  /** Whether another rate is to be asked for now. */
  isDue(nowMs: number, onEvents: boolean): boolean {
    return this.hz !== this.askedHz && nowMs - this.#askedMs >= (onEvents ? REASK_EVERY_MS : RATE_EVERY_MS);
  }

  recordAsked(nowMs: number, hz: number): void {
    this.askedHz = hz;
    this.#askedMs = nowMs;
  }
}
