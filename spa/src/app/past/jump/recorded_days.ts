import type { Span, Timeline } from '../../../past/past_types.ts';

/** An hour of the viewer's clock in which something was recorded. */
export interface RecordedHour {
  /** The first recorded moment in it, unix ms. */
  readonly atMs: number;
  /** Its start. */
  readonly fromMs: number;
  readonly faults: number;
}

/** The recorded moment nearest to a given one (the same if it was recorded); null if nothing is known to be recorded. */
export function nearestRecorded({ movement }: Timeline, momentMs: number): number | null {
  let nearest: number | null = null;
  for (const { fromMs, toMs } of movement) {
    const atMs = Math.min(Math.max(momentMs, fromMs), toMs);
    if (nearest === null || Math.abs(atMs - momentMs) < Math.abs(nearest - momentMs)) nearest = atMs;
  }
  return nearest;
}

/** The starts of the viewer's days with recorded or unknown data, newest first. */
export function listDays({ movement, unknown = [] }: Timeline): readonly number[] {
  const days = new Set<number>();
  const add = (span: Span) => {
    for (let dayMs = dayOf(span.fromMs); dayMs < span.toMs; dayMs = nextDay(dayMs)) days.add(dayMs);
  };
  for (const span of [...movement, ...unknown]) add(span);
  return [...days].sort((a, b) => b - a);
}

/** The hours of a viewer's day with recorded data. */
export function listHours({ movement, marks, fromMs }: Timeline, dayMs: number): readonly RecordedHour[] {
  const endMs = nextDay(dayMs);
  const moved = movement.filter((span) => span.toMs > dayMs && span.fromMs < endMs);
  const hours: RecordedHour[] = [];
  for (let hourMs = dayMs; hourMs < endMs; hourMs += HOUR_MS) {
    const untilMs = hourMs + HOUR_MS;
    const first = moved.find((span) => span.toMs > hourMs && span.fromMs < untilMs);
    if (first === undefined) continue;
    const faults = marks
      .filter(({ atMs, level }) => level === 'fault' && atMs >= hourMs && atMs < untilMs)
      .reduce((sum, { count = 1 }) => sum + count, 0);
    hours.push({ atMs: Math.max(hourMs, first.fromMs, fromMs), fromMs: hourMs, faults });
  }
  return hours;
}

/** The unknown parts of a viewer's day. */
export function unknownOf({ unknown = [] }: Timeline, dayMs: number): readonly Span[] {
  return unknown.filter(({ fromMs, toMs }) => toMs > dayMs && fromMs < nextDay(dayMs));
}

/** The start of the viewer's day that contains a moment. */
export function dayOf(atMs: number): number {
  const at = new Date(atMs);
  return new Date(at.getFullYear(), at.getMonth(), at.getDate()).getTime();
}

/** The start of the viewer's next day; a day may have 23 or 25 hours. */
function nextDay(dayMs: number): number {
  const day = new Date(dayMs);
  return new Date(day.getFullYear(), day.getMonth(), day.getDate() + 1).getTime();
}

const HOUR_MS = 3_600_000;
