/** Least time between two rate requests, so that a person flipping through tabs does not flood the relay. */
const RATE_EVERY_MS = 500;
/** The same for server-sent events, where every rate change needs a new connection. */
const REASK_EVERY_MS = 2000;

/** The frame rate that a viewer wants, and the one already requested. */
export class RateWish {
  /** While the page is visible and the network is fine. */
  readonly wantedHz: number;
  /** A hidden page requests no poses at all. */
  visible: boolean;
  /** Lowered rate for a slow network, only with server-sent events; null: the full rate. */
  slowHz: number | null = null;
  /** The rate requested on the newest connection; NaN: to be requested again. */
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

  /** Whether to request a different rate now. */
  isDue(nowMs: number, onEvents: boolean): boolean {
    return this.hz !== this.askedHz && nowMs - this.#askedMs >= (onEvents ? REASK_EVERY_MS : RATE_EVERY_MS);
  }

  recordAsked(nowMs: number, hz: number): void {
    this.askedHz = hz;
    this.#askedMs = nowMs;
  }
}
