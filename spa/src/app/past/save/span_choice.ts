import type { PastControls, Span } from '../../../past/past_types.ts';

export type SpanName = 'loop' | 'all' | '1' | '5' | '10' | 'custom';

const MINUTE_MS = 60_000;
/** The longest span that a file may have. */
const MOST_MINUTES = 10;

/** What can be saved, fixed when the dialog opens, because the playhead may move on. */
export interface SpanOffer {
  readonly loop: Span | null;
  /** The end of the last minutes: the shown moment, or now. */
  readonly untilMs: number;
  readonly isPast: boolean;
  readonly nowMs: number;
  /** The earliest available moment. */
  readonly oldestMs: number;
  /** A recording has no live end, so the minutes are those after the shown moment. */
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

/** The choices; the first is selected at the start. */
export function choicesOf({ loop, isRecorded, oldestMs, nowMs }: SpanOffer): readonly SpanName[] {
  const isAll = isRecorded && nowMs - oldestMs <= MOST_MINUTES * MINUTE_MS;
  const minutes: readonly SpanName[] = isAll ? ['all'] : ['1', '5', '10'];
  return [...(loop === null ? [] : ['loop' as const]), ...minutes, 'custom'];
}

/** A number of minutes, limited to what exists: the last ones, or for a recording the next ones. */
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

/** A moment in the format of `<input type="datetime-local">`, in the viewer's time zone, whole seconds. */
export function fieldOf(momentMs: number): string {
  const at = new Date(momentMs);
  const local = new Date(Math.floor(momentMs / 1000) * 1000 - at.getTimezoneOffset() * MINUTE_MS);
  return local.toISOString().slice(0, 19);
}

/** The moment in such a field; null if it is invalid. */
function momentOf(field: string): number | null {
  const ms = Date.parse(field);
  return Number.isFinite(ms) ? ms : null;
}

export interface SpanFields {
  readonly from: string;
  readonly to: string;
}

/** The initial span: a minute in whole seconds. */
export function fieldsOf(offer: SpanOffer): SpanFields {
  const { fromMs, toMs } = spanOf(offer, '1');
  return { from: fieldOf(fromMs), to: fieldOf(toMs) };
}

/** The span of two fields; null if they are invalid. */
export function customSpan({ from, to }: SpanFields): Span | null {
  const [fromMs, toMs] = [momentOf(from), momentOf(to)];
  return fromMs === null || toMs === null || toMs < fromMs ? null : { fromMs, toMs };
}
