import { BalanceReader } from '../../model/balance/balance_reader.ts';
import { manifestAt } from '../../model/files.ts';
import { type Manifest, readManifest } from '../../model/manifest.ts';
import type { Balance } from '../../twin/balance/balance.ts';
import { MARGIN } from '../../twin/balance/told/margin_channel.ts';
import { marginLimits } from '../../twin/balance/told/margin_limits.ts';
import { toldOfMasses } from '../../twin/balance/told/mass_findings.ts';
import { type Stance, StanceJudge } from '../../twin/balance/told/stance.ts';
import type { LeadState, RobotTwin } from '../../twin/robot.ts';
import { noteComputed } from '../state/own_alarms.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { settings } from '../state/settings.ts';
import { balanceText } from '../text/balance.ts';

/** The balance is computed at most this often, however many frames come. */
const EVERY_MS = 95;
/** What is not shown is no longer computed when nobody has asked for it for so long. */
const UNASKED_MS = 3000;
/** A model that could not be read is asked for again after this long. */
const AGAIN_MS = 10_000;

/** A robot's model as far as balance needs it. `raw`: its files as they are, whose masses only the picture reads. */
type KnownModel = Manifest | 'raw' | null;

/** What is known about a robot's balance by its newest frame. */
export interface KnownBalance {
  /** Whether anything of it can be known. */
  readonly possible: boolean;
  readonly stance: Stance | null;
  /** What it was judged by; null of a model without any. It is rewritten with the next frame. */
  readonly balance: Balance | null;
  /** What the model's doctor says of masses that can't be, and what of model or profile can't be read. */
  readonly findings: readonly unknown[];
  readonly problems: readonly string[];
}

/** Computes a robot's balance from its newest frames for whoever tells of it, and notes crossings of its limits. */
export class BalanceWatch {
  /** What the balance is read with; null before the model is here, and where it can't be read. */
  reader: BalanceReader | null = null;
  readonly #link: Pick<RobotLink, 'twin' | 'manifestUrl'>;
  #model: KnownModel = null;
  #url = '';
  #askedMs = Number.NEGATIVE_INFINITY;
  #judge = new StanceJudge();
  #askedForMs = Number.NEGATIVE_INFINITY;
  #lookedMs = Number.NEGATIVE_INFINITY;
  /** The way to the state that is at rest, once it has been taken. */
  #led: readonly LeadState[] | null = null;
  #known: KnownBalance | null = null;

  constructor(link: Pick<RobotLink, 'twin' | 'manifestUrl'>) {
    this.#link = link;
    link.twin.onState(this.#look);
    link.twin.onChange(this.#change);
    this.#look();
  }

  /** What is known by the newest frame; null before a frame and the model have come. */
  get known(): KnownBalance | null {
    this.#askedForMs = performance.now();
    return this.#known;
  }

  /** Whether the page shows it, by settings and robot. */
  get isShown(): boolean {
    const { balance } = settings();
    return balance === 'on' || (balance === 'auto' && this.isShownByItself);
  }

  /** Whether the page shows it unless told otherwise. */
  get isShownByItself(): boolean {
    return this.reader?.onByItself ?? false;
  }

  readonly #change = () => {
    const { schema, state } = this.#link.twin;
    if (state === null || schema !== this.reader?.schema) this.#known = null;
    if (this.#urlNow() !== this.#url) this.#look();
  };

  #urlNow(): string {
    const { twin, manifestUrl } = this.#link;
    return twin.modelHash === null ? '' : manifestUrl(twin.modelHash);
  }

  readonly #look = () => {
    const { schema, state, lead } = this.#link.twin;
    this.#ask();
    const model = this.#model;
    if (schema === null || state === null || model === null) return;
    const isLed = lead && lead !== this.#led;
    if (!isLed && state.atMs >= this.#lookedMs && state.atMs - this.#lookedMs < EVERY_MS) return;
    if (this.#known !== null && !this.isShown && performance.now() - this.#askedForMs > UNASKED_MS) return;
    this.#lookedMs = state.atMs;
    if (model === 'raw') {
      this.#known = OF_RAW_FILES;
      return;
    }
    if (isLed || model !== this.reader?.manifest || schema !== this.reader.schema) {
      this.reader = new BalanceReader(model, schema);
      this.#judge = new StanceJudge();
    }
    const { reader } = this;
    // At rest all that is told of a moment comes from the same poses, whatever was shown before.
    if (isLed) for (const one of lead) this.#take(reader, one);
    this.#led = lead;
    const { balance, stance } = this.#take(reader, state);
    const { hasAny: possible, problems } = reader;
    this.#known = { possible, stance, balance, findings: toldOfMasses(model.raw.findings), problems };
  };

  /** Takes a state, and notes what is crossed in it: a crossing counts while the page shows the balance. */
  #take(reader: BalanceReader, { codes, tS, atMs }: LeadState) {
    const { twin } = this.#link;
    const limits = marginLimits(twin.limits);
    const balance = reader.ofFrame(codes, tS);
    const stance = this.#judge.next(balance, reader.headingRad, limits);
    if (this.isShown && stance?.marginMm != null) {
      const { level, marginMm: value } = stance;
      const { threshold, owner } = limits;
      const { balance: title, margin: name } = balanceText();
      const own = owner === 'viewer';
      noteComputed(twin, title, { ...MARGIN, name, unit: 'mm', value, level }, { threshold, own }, atMs);
    }
    return { balance, stance };
  }

  /** Asks for the model that the robot has now, from where its body has it. */
  #ask(): void {
    const url = this.#urlNow();
    if (url !== this.#url) {
      this.#model = this.#known = null;
      this.#askedMs = this.#lookedMs = Number.NEGATIVE_INFINITY;
    }
    this.#url = url;
    const now = performance.now();
    if (url === '' || this.#model !== null || now - this.#askedMs < AGAIN_MS) return;
    this.#askedMs = now;
    manifestAt(url)
      .then((raw) => {
        if (url !== this.#url) return;
        this.#model = raw.v === 2 ? readManifest(raw) : 'raw';
        this.#look();
      })
      .catch(() => {}); // whoever shows the body says why; it is asked for again
  }
}

/** Of a model of raw files the picture has the ball. */
const OF_RAW_FILES: KnownBalance = {
  ...{ possible: true, stance: null, balance: null, findings: [], problems: [] },
};

const watches = new WeakMap<RobotTwin, BalanceWatch>();

/** The watch over a robot's balance, which lasts as long as the robot is shown. */
export function balanceOf(link: Pick<RobotLink, 'twin' | 'manifestUrl'>): BalanceWatch {
  const watch = watches.get(link.twin) ?? new BalanceWatch(link);
  watches.set(link.twin, watch);
  return watch;
}
