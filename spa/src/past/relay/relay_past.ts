import {
  decodeKeyPage,
  decodeSegment,
  type KeyPose,
  parseSchema,
  type Schema,
  SchemaError,
  type Segment,
  SegmentError,
} from '@posecast/wire';
import { BoundedCache, Emitter, eachOf } from '../../kit.ts';
import { decoded, nameOfRef, PastError, type PastSource, type SegmentRef } from '../past_source.ts';
import { PAGE_MS, type Span, type Timeline } from '../past_types.ts';
import { type Answer, type FetchPorts, fetchTwice, SharedRequests } from '../requests.ts';
import {
  dayOf,
  minuteOf,
  type PastSummary,
  readDay,
  readDeletions,
  readPage,
  readSummary,
} from './past_documents.ts';
import { PastIndex, pageOf } from './past_index.ts';

const TICK_MS = 2000;
const IDLE_MS = 15_000;
const REST_MS = 10_000;
/** A relay without a past, or without one for this page, is asked again after this time. */
const REFUSED_MS = 60_000;
/** A past without recorded data yet will start soon. */
const BEGINNING_MS = 3000;
const SEGMENTS_KEPT_BYTES = 8 << 20;
const KEYS_KEPT_BYTES = 4_000_000;
const SCHEMAS_KEPT = 8;
/** Target size of a page of KEYs; if there are too many, it has every n-th. */
const KEYS_BYTES_WANTED = 100_000;
const POSE_BYTES = 500; // until the first page arrives
/** The maximum number of cached pages of KEYs. */
const KEY_PAGES_MAX = KEYS_KEPT_BYTES / KEYS_BYTES_WANTED;
/** Relays make no longer segments. */
const SEGMENT_MS_MAX = 6000;
/** The default interval between KEYs. */
const USUAL_SEGMENT_MS = 4000;
const INDEX_PAGES_MAX = 1000;
/** No relay makes a page with more parts than this. */
const PARTS_MAX = 8;
const AT_ONCE = 4;

interface KeysOfPage {
  /** Their spacing, ms; 0: as many as fit. */
  readonly everyMs: number;
  readonly poses: readonly KeyPose[];
  /** Everything that starts before this is included. */
  readonly knownMs: number;
  /** When it was requested, by the page's clock. */
  readonly askedMs: number;
  /** Size of the answer. */
  readonly bytes: number;
}

/** The longest answer is a segment: 1 MiB each of header and records, plus some overhead. */
const BYTES_MAX = 3_000_000;

/** What the page provides for the past of a relay. */
export interface RelayPorts extends FetchPorts {
  /** The token for a URL, if there is one. */
  readonly tokenFor: (url: string) => string | undefined;
  /** A monotonic clock, ms. */
  readonly nowMs: () => number;
  /** Whether unprompted requests are paused: nobody sees the page, or the relay does not know the robot. */
  readonly isIdle: () => boolean;
  /** The live schema; null if there is none yet. The past almost always has the same one. */
  readonly liveSchema: () => Schema | null;
}

/** The past that a relay keeps of a robot. At first it requests only how far back the past reaches and, if that is no more than
 *  an hour, the amount of data in each minute. */
export class RelayPast implements PastSource {
  readonly #ports: RelayPorts;
  readonly #baseUrl: string;
  readonly #shared = new SharedRequests();
  readonly #index = new PastIndex();
  readonly #segments = new BoundedCache<string, Segment>(SEGMENTS_KEPT_BYTES);
  readonly #keys = new BoundedCache<number, KeysOfPage>(KEYS_KEPT_BYTES);
  readonly #schemas = new BoundedCache<string, Schema>(SCHEMAS_KEPT);
  readonly #changed = new Emitter();
  #isNear = false;
  #isAsking = false;
  #isClosed = false;
  #dueMs = Number.NEGATIVE_INFINITY; // when to request the summary again
  #restsUntilMs = Number.NEGATIVE_INFINITY; // after a failure there are no unprompted requests
  #failure = new PastError('gone', 'past: there is none');
  #newest = { toMs: 0, seenMs: 0 };
  #poseBytes = POSE_BYTES;
  #told: Timeline | null = null;
  #stopTicking: () => void = () => {};

  /** `baseUrl`: `…/api/v1/robots/{robot}/past`. */
  constructor(baseUrl: string, ports: RelayPorts) {
    this.#ports = ports;
    this.#baseUrl = baseUrl;
    this.#tick();
  }

  get timeline(): Timeline | null {
    return this.#index.timeline;
  }

  readonly onChange = this.#changed.on;

  follow(how: 'idle' | 'near'): void {
    const isNearer = how === 'near' && !this.#isNear;
    this.#isNear = how === 'near';
    if (isNearer) void this.#askNewest();
  }

  async loadDays(span: Span): Promise<void> {
    await this.#opened();
    await this.#fetchDays(span);
    this.#tell();
  }

  async loadIndex(span: Span): Promise<void> {
    await this.#opened();
    const pages = this.#index.listPages(span).filter((pageMs) => !this.#index.knows(pageMs, span.toMs));
    await eachOf(pages.slice(0, INDEX_PAGES_MAX), AT_ONCE, (pageMs) => this.#loadPage(pageMs));
  }

  get deleted(): readonly Span[] {
    return this.#index.deleted;
  }

  segmentsIn(span: Span, most?: number): readonly SegmentRef[] {
    return this.#index.segmentsIn(span, most);
  }

  async loadKeys(span: Span, everyMs = 0): Promise<void> {
    await this.#opened();
    const pages = this.#index.listPages(span).slice(0, KEY_PAGES_MAX);
    await eachOf(
      pages.filter((pageMs) => this.#lacksKeys(pageMs, span.toMs, everyMs)),
      AT_ONCE,
      (pageMs) =>
        this.#shared.ask(`keys ${pageMs} ${everyMs}`, (signal) => this.#fetchKeys(pageMs, everyMs, signal)),
    );
  }

  keyAt(momentMs: number): KeyPose | null {
    const pageMs = pageOf(momentMs);
    const poses = this.#keys.get(pageMs)?.poses;
    const first = poses?.[0];
    if (poses === undefined || first === undefined) return null;
    const isBefore = ({ atMs }: KeyPose) => atMs <= momentMs;
    if (isBefore(first)) return poses.findLast(isBefore) ?? null;
    return this.#keys.get(pageMs - PAGE_MS)?.poses.at(-1) ?? first;
  }

  async segment(ref: SegmentRef, signal?: AbortSignal): Promise<Segment> {
    signal?.throwIfAborted();
    const name = nameOfRef(ref);
    return (
      this.#segments.use(name) ??
      (await this.#shared.ask(name, (stop) => this.#fetchSegment(ref, stop), signal))
    );
  }

  async segmentBytes(ref: SegmentRef, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>> {
    return await this.#shared.ask(`bytes ${nameOfRef(ref)}`, (stop) => this.#fetchBytes(ref, stop), signal);
  }

  async schema(sha256: string): Promise<Schema> {
    return (
      this.#schemas.use(sha256) ??
      (await this.#shared.ask(sha256, (signal) => this.#fetchSchema(sha256, signal)))
    );
  }

  close(): void {
    this.#isClosed = true;
    this.#stopTicking();
    this.#shared.close();
    this.#changed.clear();
  }

  #tick(): void {
    if (this.#isClosed) return;
    this.#stopTicking = this.#ports.later(TICK_MS, () => this.#tick());
    void this.#askNewest();
  }

  /** Requests what is due, unless nobody sees the page. Never rejects. */
  async #askNewest(): Promise<void> {
    const { nowMs, isIdle } = this.#ports;
    if (this.#isAsking || this.#isClosed || nowMs() < this.#restsUntilMs || isIdle()) return;
    this.#isAsking = true;
    try {
      if (nowMs() >= this.#dueMs) await this.#open();
      if (this.#isNear) await this.#loadNewPages();
    } catch {
      this.#restsUntilMs = nowMs() + REST_MS;
    } finally {
      this.#isAsking = false;
      this.#tell();
    }
  }

  /** Resolves when it is known how far back the past reaches. Rejects with a `PastError`, also if there is no past. */
  async #opened(): Promise<void> {
    if (this.#index.summary !== null) return;
    if (this.#shared.has('past') || this.#ports.nowMs() >= this.#dueMs) await this.#open();
    if (this.#index.summary === null) throw this.#failure;
  }

  #open(): Promise<void> {
    return this.#shared.ask('past', (signal) => this.#fetchSummary(signal));
  }

  async #fetchSummary(signal: AbortSignal): Promise<void> {
    this.#dueMs = this.#ports.nowMs() + IDLE_MS;
    try {
      const { json } = await this.#getJson('', signal);
      this.#setSummary(readSummary(json));
      if (this.#index.forget(readDeletions(json))) this.#forgetDeleted();
    } catch (error) {
      if (!(error instanceof PastError)) throw error;
      this.#failure = error;
      if (error.why !== 'away') this.#dueMs += REFUSED_MS - IDLE_MS;
      if (error.why === 'gone') this.#setSummary(null);
      throw error;
    }
    if (this.#index.summary === null) {
      this.#dueMs = this.#ports.nowMs() + BEGINNING_MS;
      return;
    }
    await this.#fetchDays(null);
  }

  /** Fetches the unknown days in a span, and news about those that may have changed. */
  async #fetchDays(span: Span | null): Promise<void> {
    await eachOf(this.#index.listDaysToFetch(span), AT_ONCE, (dayMs) =>
      this.#shared.ask(`day ${dayMs}`, async (signal) => {
        const [view, { toMs }] = [this.#view, this.#index];
        const { json } = await this.#getJson(`/${view}/${dayOf(dayMs)}`, signal);
        if (view === this.#view) this.#index.setDay(dayMs, readDay(json, dayMs), toMs);
      }),
    );
  }

  #setSummary(summary: PastSummary | null): void {
    if (this.#index.setSummary(summary)) this.#keys.clear();
    this.#see();
  }

  /** Drops the loaded data of what was deleted. */
  #forgetDeleted(): void {
    this.#segments.clear();
    for (const [pageMs, keys] of this.#keys.entries()) {
      const poses = keys.poses.filter((pose) => !this.#isDeletedPose(pose));
      if (poses.length < keys.poses.length) this.#keys.set(pageMs, { ...keys, poses }, keys.bytes);
    }
  }

  /** Whether the segment of a pose may be deleted. The pose does not say when its segment begins and ends. */
  #isDeletedPose({ atMs }: KeyPose): boolean {
    return this.#index.isDeleted({ fromMs: atMs - SEGMENT_MS_MAX, toMs: atMs + SEGMENT_MS_MAX });
  }

  get #view(): string {
    return this.#index.summary?.view ?? '';
  }

  /** Records when newer data arrived. */
  #see(): void {
    const { toMs } = this.#index;
    if (toMs !== this.#newest.toMs) this.#newest = { toMs, seenMs: this.#ports.nowMs() };
  }

  /** The relay's clock as estimated by this page: now or a little earlier. */
  #relayNowMs(): number {
    return this.#newest.toMs + this.#ports.nowMs() - this.#newest.seenMs;
  }

  /** Fetches news about pages that may still grow, if a page about as new has been fetched before. */
  async #loadNewPages(): Promise<void> {
    const pages = this.#index.pagesMs.filter((pageMs) => pageMs >= pageOf(this.#index.toMs) - PAGE_MS);
    if (pages.length === 0) return;
    const growing = [...pages, pageOf(this.#index.toMs), pageOf(this.#relayNowMs())];
    const wanted = [...new Set(growing)].filter((pageMs) => !this.#index.isClosed(pageMs));
    await eachOf(wanted, AT_ONCE, (pageMs) => this.#loadPage(pageMs));
  }

  async #loadPage(pageMs: number): Promise<void> {
    await this.#shared.ask(`page ${pageMs}`, (signal) => this.#fetchPage(pageMs, signal));
    this.#tell();
  }

  async #fetchPage(pageMs: number, signal: AbortSignal): Promise<void> {
    const view = this.#view;
    const knownMs = this.#index.findKnownMs(pageMs, this.#relayNowMs());
    for (let part = 0; part < PARTS_MAX; part++) {
      const last = this.#index.getLast(pageMs);
      const after = last === null ? '' : `?after=${last.take},${last.index}`;
      const path = `/${view}/${minuteOf(pageMs)}${after}`;
      const { json, size } = await this.#getJson(path, signal);
      if (view !== this.#view) return;
      const page = readPage(json, pageMs);
      const count = this.#index.addPage(pageMs, page, size, knownMs);
      this.#see();
      if (!page.more) return;
      if (count === 0) break;
    }
    throw new PastError('damaged', `page ${minuteOf(pageMs)}: it has no end`);
  }

  #lacksKeys(pageMs: number, untilMs: number, everyMs: number): boolean {
    const keys = this.#keys.use(pageMs);
    if (keys === undefined || keys.everyMs > everyMs) return true;
    return (
      keys.knownMs < Math.min(untilMs, this.#index.toMs, pageMs + PAGE_MS) &&
      this.#ports.nowMs() - keys.askedMs >= TICK_MS
    );
  }

  async #fetchKeys(pageMs: number, everyMs: number, signal: AbortSignal): Promise<void> {
    const view = this.#view;
    const askedMs = this.#ports.nowMs();
    const knownMs = this.#index.findKnownMs(pageMs, this.#relayNowMs());
    const count = this.#index.countPoses(pageMs);
    const wholeBytes = (count ?? 0) * this.#poseBytes;
    const enough = ((count ?? PAGE_MS / USUAL_SEGMENT_MS) * everyMs) / PAGE_MS;
    const every = Math.min(1000, Math.max(1, Math.ceil(wholeBytes / KEYS_BYTES_WANTED), Math.floor(enough)));
    const path = `/${view}/${minuteOf(pageMs)}/keys${every > 1 ? `?every=${every}` : ''}`;
    const { bytes } = await this.#get(path, signal);
    const page = decoded(`past${path}`, SegmentError, () => decodeKeyPage(bytes));
    if (page.fromMs !== pageMs) throw new PastError('damaged', `past${path}: another page`);
    if (view !== this.#view) return;
    if (page.poses.length > 0) this.#poseBytes = bytes.length / page.poses.length;
    const poses = page.poses.filter((pose) => !this.#isDeletedPose(pose));
    this.#keys.set(pageMs, { everyMs, poses, knownMs, askedMs, bytes: bytes.length }, bytes.length);
  }

  async #fetchSegment(ref: SegmentRef, signal: AbortSignal): Promise<Segment> {
    const name = nameOfRef(ref);
    const path = `/${this.#view}/${name}`;
    const bytes = await this.#fetchBytes(ref, signal);
    const segment = decoded(`past${path}`, SegmentError, () => decodeSegment(bytes));
    if (segment.start.take !== ref.take || segment.start.index !== ref.index)
      throw new PastError('damaged', `past${path}: another segment`);
    this.#segments.set(name, segment, bytes.length);
    return segment;
  }

  async #fetchBytes(ref: SegmentRef, signal: AbortSignal): Promise<Uint8Array<ArrayBuffer>> {
    const path = `/${this.#view}/${nameOfRef(ref)}`;
    const { bytes, isJson } = await this.#get(path, signal);
    if (isJson) throw new PastError('gone', `past${path}: not kept any more`);
    if (bytes.length !== ref.bytes)
      throw new PastError('damaged', `past${path}: ${bytes.length} bytes, not ${ref.bytes}`);
    await checkHash(path, bytes, ref.sha256);
    return bytes;
  }

  async #fetchSchema(sha256: string, signal: AbortSignal): Promise<Schema> {
    const live = this.#ports.liveSchema();
    if (live !== null && (await hashOf(new TextEncoder().encode(live.text))) === sha256) {
      this.#schemas.set(sha256, live, 1);
      return live;
    }
    const path = `/${this.#view}/schema/${sha256}`;
    const { bytes } = await this.#get(path, signal);
    await checkHash(path, bytes, sha256);
    const schema = decoded(`past${path}`, SchemaError, () => parseSchema(new TextDecoder().decode(bytes)));
    this.#schemas.set(sha256, schema, 1);
    return schema;
  }

  /** Fetches what lies below the past's address. `path`: '', or with a leading slash. */
  #get(path: string, signal: AbortSignal): Promise<Answer> {
    const url = this.#baseUrl + path;
    const token = this.#ports.tokenFor(url);
    const headers: HeadersInit = token ? { authorization: `Bearer ${token}` } : {};
    const wanted = { url, name: `past${path}`, most: BYTES_MAX, headers, signal, cutTwice: 'away' } as const;
    return fetchTwice(wanted, this.#ports);
  }

  async #getJson(path: string, signal: AbortSignal) {
    const { bytes } = await this.#get(path, signal);
    try {
      return { json: JSON.parse(new TextDecoder().decode(bytes)) as unknown, size: bytes.length };
    } catch {
      throw new PastError('damaged', `past${path}: no JSON`);
    }
  }

  #tell(): void {
    const { timeline } = this;
    if (timeline === this.#told) return;
    this.#told = timeline;
    this.#changed.emit();
  }
}

async function checkHash(path: string, bytes: Uint8Array<ArrayBuffer>, sha256: string): Promise<void> {
  const hash = await hashOf(bytes);
  if (hash !== null && hash !== sha256) throw new PastError('damaged', `past${path}: not what its hash says`);
}

/** SHA-256 in hexadecimal. Browsers compute hashes only on https pages. Elsewhere the result is null, and the format's own checks
 *  must suffice. */
async function hashOf(bytes: Uint8Array<ArrayBuffer>): Promise<string | null> {
  const subtle = crypto.subtle as SubtleCrypto | undefined;
  if (subtle === undefined) return null;
  const hash = new Uint8Array(await subtle.digest('SHA-256', bytes));
  return [...hash].map((byte) => byte.toString(16).padStart(2, '0')).join('');
}
