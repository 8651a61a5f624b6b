import fc from 'fast-check';
import { describe, expect, it } from 'vitest';
import { Lateness, lowerHz, Silence } from '../../src/stream/lateness.ts';

it('is how much later than the quickest of its connection something came, by two clocks that share nothing', () => {
  const lateness = new Lateness();
  lateness.begin(1_000_000);
  lateness.stamped(1_000_090, 50); // the first took longer
  lateness.stamped(1_000_100, 100);
  expect(lateness.ms).toBe(0);
  lateness.stamped(1_000_400, 150);
  expect(lateness.ms).toBe(250);
  lateness.begin(1_000_500);
  expect(lateness.ms).toBe(0);
});

describe('at most, which decides what may be called LIVE', () => {
  /** Between the two clocks, ms. */
  const RELAY_MS = 7e11;

  /** A connection over a network with these delays, by a clock that starts at 0. */
  class Line {
    nowMs = 0;
    relayMs = RELAY_MS;
    readonly lateness = new Lateness();

    open(upMs: number, downMs: number): void {
      this.lateness.begin(this.nowMs);
      this.nowMs += upMs + downMs;
      this.stamp(downMs);
    }

    stamp(downMs: number): void {
      this.lateness.stamped(this.nowMs, this.relayMs + this.nowMs - downMs);
    }

    /** A question and its answer. */
    ask(upMs: number, downMs: number): void {
      const askedMs = this.nowMs;
      this.nowMs += upMs + downMs;
      this.lateness.answered(this.nowMs, askedMs, this.relayMs + this.nowMs - downMs);
    }

    get mostMs(): number {
      return Math.floor(this.lateness.mostMs(this.nowMs) + 0.01); // without a few s of drift
    }
  }

  it('of a stream that is steadily late is that, and compared with itself nothing', () => {
    const line = new Line();
    line.open(20, 4000);
    expect([line.lateness.ms, line.mostMs]).toEqual([0, 4020]);
    line.ask(20, 20);
    line.stamp(4000);
    expect([line.lateness.ms, line.mostMs]).toEqual([0, 4020]);
  });

  it('counts the way there of the best round trip, too: nobody can tell them apart', () => {
    const line = new Line();
    line.open(4000, 20);
    expect(line.mostMs).toBe(4020);
    line.ask(1200, 20);
    line.stamp(20);
    expect(line.mostMs).toBe(1220);
    line.ask(300, 300);
    line.stamp(300);
    expect(line.mostMs).toBe(600);
    line.ask(4000, 300); // while the person sends something large
    line.stamp(300);
    expect(line.mostMs, 'what was learned holds').toBe(600);
  });

  it('follows a delay that grows slowly', () => {
    const line = new Line();
    line.open(20, 20);
    for (let downMs = 20; downMs <= 4000; downMs += 20) {
      line.nowMs += 250;
      line.stamp(downMs);
      expect(line.mostMs).toBeGreaterThanOrEqual(downMs);
      expect(line.mostMs).toBeLessThan(downMs + 50);
    }
  });

  it('is the age of the connection while nothing is known', () => {
    const { lateness } = new Line();
    lateness.begin(5000, 3000);
    expect([lateness.knownMs, lateness.mostMs(9000)]).toEqual([null, 6000]);
  });

  it('is kept for the next connection to the same clock, and not for one to another', () => {
    const line = new Line();
    line.open(20, 20);
    line.open(1500, 20); // had to be opened first
    expect(line.mostMs).toBe(40);
    line.relayMs += 1e9;
    line.open(1500, 20);
    expect(line.mostMs).toBe(1520);
    line.relayMs -= 2e9;
    line.open(1500, 20);
    expect(line.mostMs).toBe(1520);
  });

  it('takes no answer by another relay’s clock', () => {
    const line = new Line();
    line.open(600, 4000);
    for (const otherMs of [-1e9, 1e9, -60_000, 60_000]) {
      const askedMs = line.nowMs;
      line.nowMs += 40;
      line.lateness.answered(line.nowMs, askedMs, line.relayMs + otherMs + askedMs + 20);
      line.stamp(4000);
      expect(line.mostMs, `${otherMs}`).toBe(4600);
    }
  });

  it('when a clock has stepped is too much, or unknown, until the next answer, and right from then on', () => {
    for (const stepMs of [30_000, -30_000]) {
      const line = new Line();
      line.open(20, 20);
      line.nowMs += 60_000;
      line.stamp(20);
      line.relayMs += stepMs;
      line.stamp(20);
      expect(line.mostMs).toBeGreaterThan(29_000);
      line.ask(20, 20);
      line.stamp(20);
      expect(line.mostMs).toBe(40);
      expect(line.lateness.ms).toBeLessThan(1);
    }
  });

  it('is the round trip if the relay does not tell its clock', () => {
    const { lateness } = new Line();
    lateness.begin(0);
    lateness.answered(4500, 500, null);
    expect(lateness.mostMs(6000)).toBe(4000);
  });

  it('is never less than the delay, whatever the ways, and clocks that drift', () => {
    const delay = fc.integer({ min: 1, max: 6000 });
    const step = fc.record({ waitMs: fc.integer({ min: 0, max: 60_000 }), upMs: delay, downMs: delay });
    const drift = fc.double({ min: -0.0002, max: 0.0002, noNaN: true });
    fc.assert(
      fc.property(drift, fc.array(step, { minLength: 1, maxLength: 60 }), (perMs, steps) => {
        const lateness = new Lateness();
        const relayMs = (nowMs: number) => Math.floor(RELAY_MS + nowMs * (1 + perMs));
        let nowMs = 0;
        lateness.begin(nowMs);
        for (const { waitMs, upMs, downMs } of steps) {
          nowMs += waitMs;
          const askedMs = nowMs;
          nowMs += upMs + downMs;
          lateness.answered(nowMs, askedMs, relayMs(askedMs + upMs));
          lateness.stamped(nowMs, relayMs(nowMs - downMs));
          expect(lateness.mostMs(nowMs)).toBeGreaterThan(downMs - 3); // rounded, twice, and drift on the way
          expect(lateness.mostMs(nowMs)).toBeLessThan(nowMs + 1);
        }
      }),
    );
  });
});

it('counts only when it lasts, and not while a connection settles', () => {
  const lateness = new Lateness();
  lateness.begin(0);
  lateness.stamped(10, 0);
  const told: number[] = [];
  for (let nowMs = 250; nowMs <= 12_000; nowMs += 250) {
    lateness.stamped(nowMs, nowMs - 2600);
    if (lateness.tooLate(nowMs)) told.push(nowMs);
  }
  expect(told[0]).toBe(9000);
});

it('lowers a rate step by step', () => {
  expect([60, 30, 10, 5, 2, 1, 0.5].map(lowerHz)).toEqual([10, 10, 5, 2, 1, 1, 0.5]);
});

it('what comes after a silence is as old as the silence until something ends it', () => {
  const silence = new Silence();
  expect(silence.ageMs(5000)).toBe(0);
  silence.begin(1000);
  silence.begin(4000);
  expect(silence.ageMs(5000)).toBe(4000);
  silence.end();
  expect(silence.ageMs(6000)).toBe(0);
});

it('only what was written after the pose was called old ends it', () => {
  const silence = new Silence();
  silence.begin(1000);
  silence.endIfWrittenAfter(3000, 2000);
  expect(silence.ageMs(5000)).toBe(4000);
  silence.endIfWrittenAfter(3001, 2000);
  expect(silence.ageMs(5000)).toBe(0);
});
