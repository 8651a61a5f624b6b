import type { PastControls, Span } from '../../../past/past_types.ts';

export type SpanName = 'loop' | '1' | '5' | '10' | 'custom';

const MINUTE_MS = 60_000;

/** What can be saved, as it was when somebody asked; the playhead may move on. */
export interface SpanOffer {
  readonly loop: Span | null;
  /** The end of the last minutes: the shown moment, or now. */
  readonly untilMs: number;
  readonly isPast: boolean;
  readonly nowMs: number;
  /** As far back as there is anything. */
  readonly oldestMs: number;
}

export function offerOf({ playhead, timeline, nowMs }: PastControls): SpanOffer {
  const { at, momentMs, loop } = playhead;
  const isPast = at === 'past';
  const untilMs = isPast ? momentMs : nowMs;
  return { loop, untilMs, isPast, nowMs, oldestMs: timeline?.fromMs ?? untilMs };
}

/** The choices, first the one that is chosen at first. */
export function choicesOf({ loop }: SpanOffer): readonly SpanName[] {
  return loop === null ? ['1', '5', '10', 'custom'] : ['loop', '1', '5', '10', 'custom'];
}

/** The last minutes, no longer than there is anything. */
export function spanOf(offer: SpanOffer, name: Exclude<SpanName, 'custom'>): Span {
  if (name === 'loop' && offer.loop !== null) return offer.loop;
  const { untilMs, oldestMs } = offer;
  return { fromMs: Math.max(oldestMs, untilMs - Number(name) * MINUTE_MS), toMs: untilMs };
}

/** A moment as `<input type="datetime-local">` has it, in the viewer's time zone, whole seconds. */
export function fieldOf(momentMs: number): string {
  const at = new Date(momentMs);
  const local = new Date(Math.floor(momentMs / 1000) * 1000 - at.getTimezoneOffset() * MINUTE_MS);
  return local.toISOString().slice(0, 19);
}

/** The moment in such a field; null while it is none. */
export function momentOf(field: string): number | null {
  const ms = Date.parse(field);
  return Number.isFinite(ms) ? ms : null;
}

export interface SpanFields {
  readonly from: string;
  readonly to: string;
}

/** At first, the last minute in whole seconds. */
export function fieldsOf(offer: SpanOffer): SpanFields {
  const { fromMs, toMs } = spanOf(offer, '1');
  return { from: fieldOf(fromMs), to: fieldOf(toMs) };
}

/** The span of two fields; null if they name none. */
export function customSpan({ from, to }: SpanFields): Span | null {
  const [fromMs, toMs] = [momentOf(from), momentOf(to)];
  return fromMs === null || toMs === null || toMs < fromMs ? null : { fromMs, toMs };
}
