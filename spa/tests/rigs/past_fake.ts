import type { EventMessage } from '@posecast/wire';
import type { Mark, PastControls, PastEvent, Playhead, Span, Timeline } from '../../src/past/past_types.ts';

/** A time line of ten minutes up to `toMs`, fully recorded, with marks some minutes before its end. */
export function timelineOf(toMs: number, minutes = 10, marks: readonly Partial<Mark>[] = []): Timeline {
  const fromMs = toMs - minutes * 60_000;
  const mark: Mark = { atMs: toMs, level: 'fault', source: 'RKN', text: 'jam', exact: true };
  return {
    ...{ fromMs, toMs, words: [] },
    movement: [{ fromMs, toMs, bytesPerS: 1000 }],
    marks: marks.map((each) => ({ ...mark, ...each })),
  };
}

/** A playhead playing at a moment of the past, with overrides. */
export function playheadAt(momentMs: number, more: Partial<Playhead> = {}): Playhead {
  return {
    ...{
      at: 'past',
      momentMs,
      playing: true,
      speed: 1,
      loop: null,
      note: null,
      askedMs: null,
      recorded: null,
    },
    ...more,
  };
}

/** Controls that record their calls, and a playhead that goes where it is told. */
export class FakePast implements PastControls {
  readonly told: string[] = [];
  readonly #listeners = new Set<() => void>();
  readonly #originMs: number;
  timeline: Timeline | null;
  heard: readonly EventMessage[] = [];
  playhead: Playhead;

  /** Moments are recorded as seconds before `originMs`, the newest moment. */
  constructor(originMs: number, timeline: Timeline | null = timelineOf(originMs)) {
    this.#originMs = originMs;
    this.timeline = timeline;
    this.playhead = playheadAt(originMs, { at: 'live' });
  }

  behindMs = 0;

  get nowMs(): number {
    return this.#originMs;
  }

  set(change: Partial<Playhead>): void {
    this.playhead = { ...this.playhead, ...change };
    for (const listener of this.#listeners) listener();
  }

  /** In the past, paused, this many seconds before the newest moment. */
  rest(agoS: number): void {
    this.set({ at: 'past', playing: false, momentMs: this.#originMs - agoS * 1000 });
  }

  readonly onChange = (listener: () => void) => {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  };

  attend(): void {
    this.told.push('attend');
  }

  /** The spans that were looked at. */
  readonly looked: Span[] = [];
  look(span: Span): void {
    this.looked.push(span);
  }

  openAt(momentMs: number): void {
    this.told.push(`open ${this.#ago(momentMs)}`);
    this.set({ at: 'past', momentMs, playing: false });
  }

  /** The result of requesting a day. */
  answerDay: (momentMs: number) => boolean = () => true;
  async loadDay(momentMs: number): Promise<boolean> {
    this.told.push(`day ${new Date(momentMs).toISOString().slice(0, 10)}`);
    await Promise.resolve();
    return this.answerDay(momentMs);
  }

  events: PastEvent[] = [];
  eventsIn({ fromMs, toMs }: Span): readonly PastEvent[] {
    return this.events.filter(({ atMs }) => atMs >= fromMs && atMs <= toMs);
  }

  /** The result of requesting the events of ten minutes. */
  answerEvents: (momentMs: number) => boolean = () => true;
  async loadEvents(momentMs: number): Promise<boolean> {
    this.told.push(`events ${this.#ago(momentMs)}`);
    await Promise.resolve();
    return this.answerEvents(momentMs);
  }

  seek(momentMs: number, scrubbing = false): void {
    this.told.push(`${scrubbing ? 'scrub' : 'seek'} ${this.#ago(momentMs)}`);
    this.set({ at: 'past', momentMs });
  }

  settle(): void {
    this.told.push('settle');
  }

  toggle(): void {
    this.told.push('toggle');
    this.set(
      this.playhead.at === 'live' ? { at: 'past', playing: false } : { playing: !this.playhead.playing },
    );
  }

  setSpeed(speed: Playhead['speed']): void {
    this.told.push(`speed ${speed}`);
    this.set({ speed });
  }

  skip(byMs: number): void {
    this.told.push(`skip ${byMs}`);
  }

  step(by: 1 | -1): void {
    this.told.push(`step ${by}`);
  }

  setLoop(loop: Playhead['loop']): void {
    this.told.push(loop === null ? 'no loop' : `loop ${this.#ago(loop.fromMs)} to ${this.#ago(loop.toMs)}`);
    this.set({ loop });
  }

  visitFault(by: 1 | -1): void {
    this.told.push(`fault ${by}`);
  }

  goLive(): void {
    this.told.push('live');
    this.set({ at: 'live', momentMs: this.#originMs, playing: true });
  }

  #ago(momentMs: number): number {
    return Math.round((this.#originMs - momentMs) / 100) / 10;
  }
}
