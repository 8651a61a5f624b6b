import { perObject } from '../../kit.ts';
import { BalanceReader } from '../../model/balance/balance_reader.ts';
import { manifestAt } from '../../model/files.ts';
import { type Manifest, readManifest } from '../../model/manifest.ts';
import type { ShownBalance } from '../../scene/signs/balance_drawing.ts';
import type { Balance } from '../../twin/balance/balance.ts';
import { toldOfMasses } from '../../twin/balance/lacks.ts';
import { MARGIN, marginLimits, type Stance, StanceJudge } from '../../twin/balance/stance.ts';
import { DerivedHistory, type History } from '../../twin/plots/history.ts';
import type { DerivedTraces, Trace, TraceReading } from '../../twin/plots/trace.ts';
import type { LeadState } from '../../twin/robot.ts';
import { noteComputed } from '../state/own_alarms.ts';
import { bodySigns, type RobotLink } from '../state/robot_link.ts';
import { settings } from '../state/settings.ts';
import { type BalanceText, balanceText } from '../text/late.ts';

/** The minimum interval between computations, however many frames arrive. */
const EVERY_MS = 95;
/** While balance is hidden, computing stops when nobody has asked for this long. */
const UNASKED_MS = 3000;
/** Without a new picture for this long, none is drawn any more. */
const DRAWN_MS = 3000;
/** A model that failed to load is requested again after this long. */
const AGAIN_MS = 10_000;

/** The parts of a robot's model that balance needs. `raw`: the model is raw files, whose masses only the 3D view reads. */
type KnownModel = Manifest | 'raw' | null;

/** A robot's balance at its newest frame, as far as it is known. */
export interface KnownBalance {
  /** Whether any of it can be known. */
  readonly possible: boolean;
  readonly stance: Stance | null;
  /** The data behind the verdict; null if the model has none. Overwritten by the next frame. */
  readonly balance: Balance | null;
  /** The implausible masses that the model doctor found, and the parts of the model or profile that can't be read. */
  readonly findings: readonly unknown[];
  readonly problems: readonly string[];
}

/** Computes a robot's balance from its newest frames for all parts of the page that show it, and records when it crosses a
 *  limit. */
export class BalanceWatch {
  /** Reads the balance from frames; null before the model has loaded, and if balance can't be read. */
  reader: BalanceReader | null = null;
  readonly #link: Pick<RobotLink, 'twin' | 'manifestUrl'>;
  #model: KnownModel = null;
  #url = '';
  #askedMs = Number.NEGATIVE_INFINITY;
  #judge = new StanceJudge();
  #askedForMs = Number.NEGATIVE_INFINITY;
  #lookedMs = Number.NEGATIVE_INFINITY;
  /** The states that led up to the state at rest, once processed. */
  #led: readonly LeadState[] | null = null;
  #known: KnownBalance | null = null;

  constructor(link: Pick<RobotLink, 'twin' | 'manifestUrl'>) {
    this.#link = link;
    link.twin.onState(this.#look);
    link.twin.onChange(this.#change);
    this.#look();
  }

  /** The balance at the newest frame; null before a frame and the model have arrived. While somebody asks, it is computed even if it is
   *  hidden. */
  known(): KnownBalance | null {
    this.#askedForMs = performance.now();
    return this.#known;
  }

  /** Whether the page shows balance, given the settings and the robot. */
  get isShown(): boolean {
    const { balance } = settings();
    return balance === 'on' || (balance === 'auto' && this.isShownByItself);
  }

  /** Whether the page shows balance by default. */
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
    // While the shown moment stands still, everything about it comes from the same poses, whatever was shown before.
    if (isLed) for (const one of lead) this.#take(reader, one);
    this.#led = lead;
    const { balance, stance } = this.#take(reader, state);
    const { hasAny: possible, problems } = reader;
    this.#known = { possible, stance, balance, findings: toldOfMasses(model.raw.findings), problems };
  };

  /** Processes a state, and records limit crossings in it. Crossings count only while the page shows balance. */
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

  /** Loads the robot's current model from the same place as the body. */
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
      .catch(() => {}); // the body reports the reason; the model is requested again
  }
}

/** for a model of raw files, the 3D view draws the ball */
const OF_RAW_FILES: KnownBalance = {
  ...{ possible: true, stance: null, balance: null, findings: [], problems: [] },
};

/** When a picture was first seen here, ms; each has its own object. */
const seenMs = perObject((_: object) => performance.now());

/** The stance to tell of: that of the pose on the screen, which on a slow device is older than the newest one; without a picture,
 *  the newest. */
export function stanceShown(link: Pick<RobotLink, 'twin' | 'manifestUrl'>): Stance | null {
  const newest = balanceOf(link).known()?.stance ?? null;
  const drawn = bodySigns(link).signs?.drawn.balance as ShownBalance | null | undefined;
  if (drawn?.stance == null || newest === null) return newest;
  const isOnScreen = drawn.tS === link.twin.state?.tS || performance.now() - seenMs(drawn) < DRAWN_MS;
  return isOnScreen ? drawn.stance : newest;
}

/** The balance watch of a robot. */
export const balanceOf = perObject((link: Pick<RobotLink, 'twin' | 'manifestUrl'>) => new BalanceWatch(link));

/** A balance number that can be listed and plotted. */
interface BalanceValue {
  readonly field: string;
  readonly label: string;
  readonly name: keyof BalanceText & ('margin' | 'massX' | 'massY' | 'massZ' | 'pressureX' | 'pressureY');
  readonly unit: 'mm' | 'm';
  /** The key of its explanation. */
  readonly explain: string;
}

const { field } = MARGIN;

/** The balance numbers, in the order `writeValues` uses. */
export const VALUES: readonly BalanceValue[] = [
  { ...MARGIN, name: 'margin', unit: 'mm', explain: 'balance.margin' },
  { field, label: 'mass.x', name: 'massX', unit: 'm', explain: 'balance.mass' },
  { field, label: 'mass.y', name: 'massY', unit: 'm', explain: 'balance.mass' },
  { field, label: 'mass.z', name: 'massZ', unit: 'm', explain: 'balance.mass' },
  { field, label: 'pressure.x', name: 'pressureX', unit: 'm', explain: 'balance.pressure' },
  { field, label: 'pressure.y', name: 'pressureY', unit: 'm', explain: 'balance.pressure' },
];

/** Writes the numbers of one balance result: the margin in mm, the rest in metres in world coordinates; NaN where unknown. */
export function writeValues({ marginM, centreOfMass, pressure }: Balance, into: Float64Array): void {
  into[0] = marginM === null ? Number.NaN : marginM * 1000;
  for (let i = 0; i < 3; i += 1) into[1 + i] = centreOfMass?.[i] ?? Number.NaN;
  for (let i = 0; i < 2; i += 1) into[4 + i] = pressure?.[i] ?? Number.NaN;
}

/** The display resolution, in each value's unit. */
const SCALE = { mm: 0.1, m: 0.001 } as const;

/** The last minute of a robot's balance, for plots. Computed from the raw codes in its history, a few at a time. */
class BalanceTraces implements DerivedTraces {
  readonly #watch: BalanceWatch;
  #madeFor: BalanceReader | null = null;
  #history: DerivedHistory | null = null;

  constructor(watch: BalanceWatch) {
    this.#watch = watch;
  }

  reading({ field, label }: Trace): TraceReading | null {
    const column = VALUES.findIndex((value) => value.field === field && value.label === label);
    const value = VALUES[column];
    if (value === undefined) return null;
    const text = balanceText();
    return {
      title: `${text.balance}: ${text[value.name]}`,
      unit: value.unit,
      scale: SCALE[value.unit],
      read: (_codes, atMs = Number.NaN) => this.#history?.value(column, atMs) ?? null,
      ofJoint: false,
    };
  }

  update(history: History, nowMs: number): boolean {
    const shown = this.#watch.reader;
    if (shown === null) return false;
    const { manifest, schema } = shown;
    if (manifest !== this.#madeFor?.manifest || schema !== this.#madeFor.schema) {
      this.#madeFor = shown;
      // A separate reader, because the watch's reader moves on with the newest frames.
      const reader = new BalanceReader(manifest, schema);
      this.#history = new DerivedHistory(schema, VALUES.length, (codes, atMs, into) =>
        writeValues(reader.ofFrame(codes, atMs / 1000), into),
      );
    }
    return this.#history?.update(history, nowMs) ?? false;
  }
}

/** The traces of a robot's balance. */
export const balanceTraces = perObject(
  (link: Pick<RobotLink, 'twin' | 'manifestUrl'>): DerivedTraces => new BalanceTraces(balanceOf(link)),
);
