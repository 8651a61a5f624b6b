import { describe, expect, it } from 'vitest';
import {
  type Evidence,
  HOLDING_AFTER_MS,
  HoldUps,
  JOINING_MS,
  judge,
  STALE_AFTER_MS,
  type Status,
} from '../../src/twin/liveness.ts';
import { RobotTwin } from '../../src/twin/robot.ts';

const NOW = 1_000_000;

function status(changed: Partial<Status> = {}): Status {
  return {
    robot: 'online',
    ageMs: 20,
    seq: 100,
    degraded: false,
    overShare: false,
    atMs: NOW - 300,
    ...changed,
  };
}

/** A healthy robot, seen by a viewer with a good connection. */
function evidence(changed: Partial<Evidence> = {}): Evidence {
  return {
    openedMs: NOW - 60_000,
    connected: true,
    lostMs: null,
    heardMs: NOW - 30,
    status: status(),
    freshMs: NOW - 30,
    changedMs: NOW - 30,
    watchingMs: NOW - 60_000,
    shownMs: NOW - 30,
    otherwiseMs: null,
    transitMs: 20,
    holdUps: new HoldUps(),
    ...changed,
  };
}

describe('the table of causes', () => {
  it('all well', () => {
    expect(judge(evidence(), NOW)).toMatchObject({ word: 'LIVE', cause: null, ageMs: 30, linkMs: 30 });
  });

  it('all well, pose unchanged', () => {
    const still = evidence({ changedMs: NOW - 12_000 });
    expect(judge(still, NOW)).toMatchObject({ word: 'HOLDING', cause: null, unchangedMs: 12_000 });
    const only = evidence({ changedMs: NOW - HOLDING_AFTER_MS + 1 });
    expect(judge(only, NOW).word).toBe('LIVE');
  });

  it('robot or source silent, edge alive', () => {
    const silent = evidence({ freshMs: NOW - 1700, status: status({ robot: 'silent', ageMs: 1400 }) });
    expect(judge(silent, NOW)).toMatchObject({ word: 'STALE', cause: 'robot silent', ageMs: 1700 });
  });

  it('the age goes on by the viewer’s own clock when status still says online', () => {
    const quiet = evidence({ freshMs: NOW - 1501, status: status({ ageMs: 1250 }) });
    expect(judge(quiet, NOW)).toMatchObject({ word: 'STALE', cause: 'robot silent', ageMs: 1501 });
    expect(judge(quiet, NOW - 2).word).toBe('LIVE');
  });

  it('the picture is old though all else is new: of the relay’s doing, and of a lane the page’s', () => {
    const behind = { shownMs: NOW - 6600, otherwiseMs: NOW - 6000, watchingMs: NOW - 60_000 };
    expect(judge(evidence(behind), NOW)).toMatchObject({
      ...{ word: 'STALE', cause: 'relay degraded', ageMs: 6600 },
    });
    const inLane = evidence({ ...behind, status: status({ endsMs: NOW + 3000 }) });
    expect(judge(inLane, NOW)).toMatchObject({ word: 'STALE', cause: null, ageMs: 6600 });
  });

  it('edge or uplink gone', () => {
    const gone = evidence({ status: status({ robot: 'offline', ageMs: 2000 }) });
    expect(judge(gone, NOW)).toMatchObject({ word: 'OFFLINE', cause: null });
  });

  it('robot sends too much: told beside the word while the relay that says so is heard', () => {
    const over = status({ overShare: true });
    expect(judge(evidence({ status: over }), NOW)).toMatchObject({ word: 'LIVE', overShare: true });
    expect(judge(evidence(), NOW).overShare).toBe(false);
    const still = evidence({ status: over, changedMs: NOW - 12_000 });
    expect(judge(still, NOW)).toMatchObject({ word: 'HOLDING', overShare: true });
    const silent = evidence({ status: { ...over, robot: 'silent' }, freshMs: null });
    expect(judge(silent, NOW)).toMatchObject({ word: 'STALE', overShare: true });
    const lost = evidence({ status: over, heardMs: NOW - 2000 });
    expect(judge(lost, NOW)).toMatchObject({ cause: 'no connection', overShare: false });
    const gone = evidence({ status: { ...over, robot: 'offline' } });
    expect(judge(gone, NOW)).toMatchObject({ word: 'OFFLINE', overShare: false });
  });

  it('a frame that was under way when the robot left does not bring it back', () => {
    const late = evidence({ status: status({ robot: 'offline' }), freshMs: NOW });
    expect(judge(late, NOW).word).toBe('OFFLINE');
  });

  it('relay or the viewer’s own network gone', () => {
    const lost = evidence({ connected: false, lostMs: NOW - 10 });
    expect(judge(lost, NOW)).toMatchObject({ word: 'STALE', cause: 'no connection' });
    const frozen = evidence({ heardMs: NOW - 1501, freshMs: NOW - 1501 });
    expect(judge(frozen, NOW)).toMatchObject({ word: 'STALE', cause: 'no connection' });
    const at = { freshMs: NOW - 1500, shownMs: NOW - 1500, status: status({ atMs: NOW - 1600, ageMs: 0 }) };
    const first = evidence({ ...at, heardMs: NOW - 1300, transitMs: 200 });
    expect(judge(first, NOW), 'from its first moment on').toMatchObject({ cause: 'no connection' });
    const seen = { ...first, status: status({ atMs: NOW - 1480, ageMs: 0 }) };
    expect(judge(seen, NOW), 'nor is the relay to blame').toMatchObject({ cause: 'no connection' });
    const told = evidence({ ...at, heardMs: NOW - 900, transitMs: 200 });
    expect(judge(told, NOW), 'the relay has spoken since').toMatchObject({ cause: 'robot silent' });
  });

  it('a stream in parts whose next part does not come: of the robot nothing is known', () => {
    const over = status({ atMs: NOW - 100, ageMs: 1399, endsMs: NOW - 1400 });
    const waits = { status: over, freshMs: NOW - 1499, shownMs: NOW - 1499 };
    expect(judge(evidence(waits), NOW)).toMatchObject({ word: 'LIVE', cause: null });
    expect(judge(evidence(waits), NOW + 1)).toMatchObject({
      word: 'STALE',
      cause: 'waiting for the next part',
    });
    const silent = evidence({ ...waits, status: { ...over, robot: 'silent' } });
    expect(judge(silent, NOW + 1)).toMatchObject({ word: 'STALE', cause: 'robot silent' });
    const within = evidence({ ...waits, status: { ...over, endsMs: NOW + 500 } });
    expect(judge(within, NOW + 1)).toMatchObject({ word: 'STALE', cause: 'robot silent' });
  });

  it('a stream that arrives late, however steadily', () => {
    const late = (transitMs: number) => {
      const of = { freshMs: NOW - transitMs - 30, shownMs: NOW - transitMs - 30, transitMs };
      return evidence({ ...of, status: status({ atMs: NOW - transitMs - 300, heardMs: NOW - 300 }) });
    };
    expect(judge(late(600), NOW)).toMatchObject({ word: 'LIVE', ageMs: 630 });
    expect(judge(late(1469), NOW)).toMatchObject({ word: 'LIVE', ageMs: 1499 });
    expect(judge(late(1470), NOW)).toMatchObject({ word: 'STALE', cause: 'slow network', ageMs: 1500 });
    expect(judge(late(4000), NOW)).toMatchObject({ word: 'STALE', cause: 'slow network', ageMs: 4030 });
    expect(judge({ ...late(4000), changedMs: NOW - 9000 }, NOW).word, 'nor HOLDING').toBe('STALE');
    expect(judge({ ...late(4000), watchingMs: null }, NOW).word, 'a hidden page').toBe('STALE');
    const silent = { ...late(600), freshMs: NOW - 3600, shownMs: NOW - 3600 };
    const quiet = { ...silent, status: status({ ageMs: 3000, atMs: NOW - 600 }) };
    expect(judge(quiet, NOW), 'the robot’s own silence').toMatchObject({ cause: 'robot silent' });
    const opening = { ...late(1800), openedMs: NOW - 2000 };
    expect(judge(opening, NOW).word, 'its age may soon be known better').toBeNull();
    expect(judge({ ...late(1800), openedMs: NOW - JOINING_MS - 1 }, NOW).word).toBe('STALE');
    const gone = status({ robot: 'offline', atMs: NOW - 4300, heardMs: NOW - 300 });
    expect(judge({ ...late(4000), status: gone }, NOW).word, 'no claim of being current').toBe('OFFLINE');
  });

  it('a relay that cannot vouch for what it serves', () => {
    const degraded = evidence({ status: status({ degraded: true }) });
    expect(judge(degraded, NOW)).toMatchObject({ word: 'STALE', cause: 'relay degraded' });
  });
});

describe('joining', () => {
  const opening = { connected: false, heardMs: null, status: null, freshMs: null, shownMs: null };

  it('claims nothing in the first moments, then says that there is no connection', () => {
    expect(judge(evidence({ ...opening, openedMs: NOW - JOINING_MS }), NOW).word).toBeNull();
    expect(judge(evidence({ ...opening, openedMs: NOW - JOINING_MS - 1 }), NOW)).toMatchObject({
      word: 'STALE',
      cause: 'no connection',
    });
  });

  it('a dead robot is never LIVE, though its last pose has just arrived', () => {
    const dead = status({ robot: 'silent', ageMs: 90_000, atMs: NOW });
    const joined = evidence({
      openedMs: NOW - 100,
      status: dead,
      freshMs: null,
      changedMs: NOW,
      heardMs: NOW,
    });
    for (let later = 0; later < 5000; later += 50) {
      const verdict = judge({ ...joined, heardMs: NOW + later }, NOW + later);
      expect(verdict).toMatchObject({ word: 'STALE', cause: 'robot silent', ageMs: 90_000 + later });
    }
  });

  it('a robot that never was here is OFFLINE without an age', () => {
    const never = evidence({ status: status({ robot: 'offline', ageMs: null, seq: null }), freshMs: null });
    expect(judge(never, NOW)).toMatchObject({ word: 'OFFLINE', ageMs: null });
  });

  it('a new connection is not trusted before its first status', () => {
    expect(judge(evidence({ status: null }), NOW)).toMatchObject({ word: 'STALE', cause: 'no connection' });
  });
});

describe('the picture', () => {
  it('is not called LIVE before it shows a pose of this connection', () => {
    const joined = evidence({ watchingMs: NOW - 100, shownMs: null, changedMs: null });
    expect(judge(joined, NOW).word).toBeNull();
    expect(judge({ ...joined, shownMs: NOW }, NOW).word).toBe('LIVE');
  });

  it('is STALE when poses no longer come though the relay says that the robot is well', () => {
    const cut = evidence({ shownMs: NOW - 1501, freshMs: NOW - 1501, status: status({ atMs: NOW }) });
    expect(judge(cut, NOW)).toMatchObject({ word: 'STALE', cause: 'relay degraded' });
    const never = evidence({ watchingMs: NOW - 1501, shownMs: null });
    expect(judge(never, NOW)).toMatchObject({ word: 'STALE', cause: 'relay degraded' });
  });

  it.each([
    [
      'its own hold-ups',
      [
        [2000, 1300],
        [1250, 100],
      ],
      'busy browser',
    ],
    [
      'hold-ups of two threads, counted once',
      [
        [1500, 900],
        [1500, 900],
        [1400, 950],
      ],
      'relay degraded',
    ],
    ['hold-ups of before', [[9000, 1600]], 'relay degraded'],
    ['a sleep', [[31_000, 100]], 'relay degraded'],
    [
      'moments',
      [
        [1500, 1200],
        [1100, 750],
        [700, 350],
      ],
      'relay degraded',
    ],
  ])('of a page with %s is late for that reason, or for another', (_what, spans, cause) => {
    const holdUps = new HoldUps();
    for (const [from = 0, to = 0] of spans) holdUps.record(NOW - from, NOW - to);
    const late = { shownMs: NOW - 1600, freshMs: NOW - 1600, holdUps };
    expect(judge(evidence({ ...late, status: status({ atMs: NOW }) }), NOW).cause).toBe(cause);
    const cut = evidence({ ...late, heardMs: NOW - 1600 });
    expect(judge(cut, NOW).cause).toBe(cause === 'busy browser' ? cause : 'no connection');
  });

  it('of before an outage, however short, is not LIVE, and the first of after it is', () => {
    const back = evidence({ otherwiseMs: NOW - 400, watchingMs: NOW - 390 });
    expect(judge({ ...back, shownMs: NOW - 500 }, NOW).word).toBeNull();
    expect(judge({ ...back, shownMs: NOW - 400 }, NOW).word, 'of that very moment').toBeNull();
    expect(judge({ ...back, shownMs: NOW - 399 }, NOW).word).toBe('LIVE');
  });

  it('of a hidden page, which asks for no poses, is told by status alone', () => {
    const hidden = evidence({ watchingMs: null, shownMs: null, changedMs: null });
    expect(judge(hidden, NOW).word).toBe('LIVE');
  });
});

describe('a status each 0.97 s, each of them 0 to 800 ms under way', () => {
  const EVERY_MS = 970;
  const cases: [string, Partial<Evidence>, Partial<Status>, string][] = [
    ['to a hidden page, which asks for no poses', { watchingMs: null, shownMs: null }, { ageMs: 33 }, 'LIVE'],
    ['of a robot that has left', {}, { robot: 'offline', ageMs: 90_000 }, 'OFFLINE'],
    ['of a robot that is silent', {}, { robot: 'silent', ageMs: 90_000 }, 'robot silent'],
  ];
  it.each(cases)('%s', (_, seen, said, expected) => {
    let seed = 7;
    const underWay = () => {
      seed = (seed * 1103515245 + 12345) % 2 ** 31;
      return (seed / 2 ** 31) * 800;
    };
    let arrived = NOW;
    for (let sent = NOW + EVERY_MS; sent < NOW + 300_000; sent += EVERY_MS) {
      const next = Math.max(arrived, sent + underWay());
      const unheard = { freshMs: null, changedMs: null, shownMs: null, heardMs: arrived, ...seen };
      const found = judge(evidence({ ...unheard, status: status({ ...said, atMs: arrived }) }), next - 1);
      expect(expected).toBe(found.cause ?? found.word);
      arrived = next;
    }
  });
});

const T = 10_000;

const told = (atMs: number, changed: Partial<Status> = {}) => status({ ageMs: 30, seq: 7, atMs, ...changed });

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
