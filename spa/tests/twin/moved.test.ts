import { describe, expect, it } from 'vitest';
import { judge, STALE_AFTER_MS, type Status } from '../../src/twin/liveness.ts';
import { RobotTwin } from '../../src/twin/robot.ts';

const T = 10_000;

const told = (atMs: number, changed: Partial<Status> = {}): Status => ({
  robot: 'online',
  ageMs: 30,
  seq: 7,
  degraded: false,
  overShare: false,
  atMs,
  ...changed,
});

/** The status of a relay that has not read the robot's state yet. */
const UNKNOWING: readonly Partial<Status>[] = [
  { robot: 'offline', ageMs: null, seq: null },
  { robot: 'offline' }, // but it has already heard frames
  { robot: 'silent', ageMs: null, seq: null },
  { degraded: true },
];

/** A page that was live at T, and was then moved to another relay. */
function moved(): RobotTwin {
  const twin = new RobotTwin('r', 0);
  twin.acceptConnection(true, T);
  twin.acceptStatus(told(T));
  twin.evidence.shownMs = T;
  twin.acceptMove();
  return twin;
}

const word = (twin: RobotTwin, nowMs: number) => judge(twin.evidence, nowMs).word;

describe('a page that was moved to another relay', () => {
  it('goes by what the one before has told, until that is old', () => {
    for (const unknowing of UNKNOWING) {
      const twin = moved();
      twin.acceptStatus(told(T + 100, unknowing));
      expect(word(twin, T + 100)).toBe('LIVE');
      expect(word(twin, T + STALE_AFTER_MS)).toBe('STALE');
      twin.acceptStatus(told(T + STALE_AFTER_MS, unknowing));
      expect(word(twin, T + STALE_AFTER_MS)).toBe(unknowing.robot === 'offline' ? 'OFFLINE' : 'STALE');
    }
  });

  it('believes the new one from its first news on', () => {
    const twin = moved();
    twin.acceptStatus(told(T + 100, { robot: 'silent' }));
    expect(word(twin, T + 100)).toBe('STALE');
    for (const unknowing of UNKNOWING) {
      const other = moved();
      other.acceptStatus(told(T + 100));
      other.acceptStatus(told(T + 200, unknowing));
      expect(word(other, T + 200)).not.toBe('LIVE');
    }
  });

  it('knows nothing of a connection that was lost meanwhile', () => {
    const twin = moved();
    twin.acceptConnection(false, T + 100);
    twin.acceptConnection(true, T + 200);
    twin.acceptStatus(told(T + 200, { robot: 'offline', ageMs: null, seq: null }));
    expect(word(twin, T + 200)).toBe('OFFLINE');
  });
});
