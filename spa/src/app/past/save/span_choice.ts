import type { PastControls, Span } from '../../../past/past_types.ts';

export type SpanName = 'loop' | 'all' | '1' | '5' | '10' | 'custom';

const MINUTE_MS = 60_000;
/** A file takes no more. */
const MOST_MINUTES = 10;

/** What can be saved, as it was when somebody asked; the playhead may move on. */
export interface SpanOffer {
  readonly loop: Span | null;
  /** The end of the last minutes: the shown moment, or now. */
  readonly untilMs: number;
  readonly isPast: boolean;
  readonly nowMs: number;
  /** As far back as there is anything. */
  readonly oldestMs: number;
  /** Nothing comes after it: the minutes are those from the shown moment on. */
  readonly isRecorded: boolean;
}

export function offerOf({ playhead, timeline, nowMs }: PastControls): SpanOffer {
  const { at, momentMs, loop } = playhead;
  const isPast = at === 'past';
  const untilMs = isPast ? momentMs : nowMs;
  return {
    loop,
    untilMs,
    isPast,
    nowMs,
    oldestMs: timeline?.fromMs ?? untilMs,
    isRecorded: playhead.recorded !== null,
  };
}

/** The choices, first the one that is chosen at first. */
export function choicesOf({ loop, isRecorded, oldestMs, nowMs }: SpanOffer): readonly SpanName[] {
  const isAll = isRecorded && nowMs - oldestMs <= MOST_MINUTES * MINUTE_MS;
  const minutes: readonly SpanName[] = isAll ? ['all'] : ['1', '5', '10'];
  return [...(loop === null ? [] : ['loop' as const]), ...minutes, 'custom'];
}

/** Some minutes, no longer than there is anything: the last ones; of a recording those that come. */
export function spanOf(offer: SpanOffer, name: Exclude<SpanName, 'custom'>): Span {
  if (name === 'loop' && offer.loop !== null) return offer.loop;
  const { untilMs, oldestMs, nowMs, isRecorded } = offer;
  if (name === 'all') return { fromMs: oldestMs, toMs: nowMs };
  if (isRecorded) {
    const toMs = Math.min(nowMs, untilMs + Number(name) * MINUTE_MS);
    return { fromMs: Math.max(oldestMs, toMs - Number(name) * MINUTE_MS), toMs };
  }
  return { fromMs: Math.max(oldestMs, untilMs - Number(name) * MINUTE_MS), toMs: untilMs };
}

/** A moment as `<input type="datetime-local">` has it, in the viewer's time zone, whole seconds. */
export function fieldOf(momentMs: number): string {
  const at = new Date(momentMs);
  const local = new Date(Math.floor(momentMs / 1000) * 1000 - at.getTimezoneOffset() * MINUTE_MS);
  return local.toISOString().slice(0, 19);
}

/** The moment in such a field; null while it is none. */
function momentOf(field: string): number | null {
  const ms = Date.parse(field);
  return Number.isFinite(ms) ? ms : null;
}

export interface SpanFields {
  readonly from: string;
  readonly to: string;
}

/** At first, a minute in whole seconds. */
export function fieldsOf(offer: SpanOffer): SpanFields {
  const { fromMs, toMs } = spanOf(offer, '1');
  return { from: fieldOf(fromMs), to: fieldOf(toMs) };
}

/** The span of two fields; null if they name none. */
export function customSpan({ from, to }: SpanFields): Span | null {
  const [fromMs, toMs] = [momentOf(from), momentOf(to)];
  return fromMs === null || toMs === null || toMs < fromMs ? null : { fromMs, toMs };
}
