import { WIRE_VERSION } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { MirrorReader } from '../../src/stream/firebase_mirror.ts';
import type { Action } from '../../src/stream/messages.ts';
import { Session, SILENT_LIMIT_MS } from '../../src/stream/session.ts';
import type { StreamEvent } from '../../src/stream/sse.ts';
import { judge } from '../../src/twin/liveness.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { Frames, SCHEMA_TEXT } from '../rigs/schema.ts';

const URL_ = 'https://lab.firebaseio.com/posecast/r.json';
const base64 = (bytes: Uint8Array) => Buffer.from(bytes).toString('base64');
const bytesOf = (text: string) => Uint8Array.from(Buffer.from(text, 'base64'));

/** Reader, session and twin connected as in worker and page, with a manual clock. */
class Rig {
  now = 1_000_000;
  /** The relay has a different clock. */
  at = 77_000;
  readonly reader = new MirrorReader(WIRE_VERSION);
  readonly session = new Session(URL_, 30, true, () => 0.5);
  readonly twin = new RobotTwin('r', this.now);
  readonly actions: Action[] = [];
  readonly seqs: number[] = [];
  readonly #frames = new Frames();
  /** For the newest written frame. */
  seq = 0;

  constructor() {
    this.#do(this.session.start(this.now));
    this.#do(this.session.opened(this.now));
  }

  #do(actions: readonly Action[]): void {
    for (const action of actions) {
      this.actions.push(action);
      if (action.do !== 'post') continue;
      const { message } = action;
      if (message.kind === 'schema') this.twin.acceptSchema(message.schema);
      else if (message.kind === 'status') this.twin.acceptStatus(message.status);
      else if (message.kind === 'link') this.twin.acceptConnection(message.phase === 'open', this.now);
      else if (message.kind === 'state') {
        this.twin.acceptState(message.state);
        this.seqs.push(message.state.seq);
      }
    }
  }

  #hear(events: readonly StreamEvent[]): void {
    for (const { name, data, writtenMs } of events) {
      if (Number.isFinite(writtenMs)) this.session.stamped(this.now, writtenMs);
      this.#do(
        name === 'frame' ? this.session.binary(this.now, bytesOf(data)) : this.session.text(this.now, data),
      );
    }
  }

  hear(name: string, path: string, data: unknown): void {
    const said = this.reader.read(this.now, { name, data: JSON.stringify({ path, data }) });
    if (typeof said === 'number') throw new Error(`ended with ${said}`);
    this.#hear(said);
  }

  /** A whole node, as it is at first. */
  node(changed: object = {}): object {
    const key = this.frame(true);
    const schema = base64(new TextEncoder().encode(SCHEMA_TEXT));
    return { schema, key, frame: key, status: this.status(), ...changed };
  }

  /** The next one: the robot moves. */
  frame(isKey = false): string {
    this.seq += 1;
    return base64(this.#frames.next({ 'pos.RKN': this.seq }, isKey));
  }

  status(changed: object = {}): object {
    return { robot: 'online', age_ms: 20, seq: this.seq, at: this.at, model: null, ...changed };
  }

  /** What a relay writes twice a second. */
  write(changed: object = {}): void {
    this.hear('patch', '/', { frame: this.frame(), status: this.status(changed) });
  }

  pass(ms: number, stepMs = 250): void {
    for (const until = this.now + ms; this.now < until; ) {
      this.now += stepMs;
      this.at += stepMs;
      this.#do(this.session.tick(this.now));
      this.#hear(this.reader.tick(this.now));
    }
  }

  get verdict() {
    return judge(this.twin.evidence, this.now);
  }
}

function live(): Rig {
  const rig = new Rig();
  rig.hear('put', '/', rig.node());
  rig.pass(500);
  rig.write();
  return rig;
}

describe('a mirror', () => {
  it('is read at its own address, with nothing said to it', () => {
    const rig = live();
    for (let turn = 0; turn < 40; turn++) {
      rig.pass(500);
      rig.write();
    }
    const asked = rig.actions.filter(({ do: what }) => what !== 'post');
    expect(asked).toEqual([{ do: 'connect', by: 'mirror', url: URL_ }]);
    expect(rig.verdict.word).toBe('LIVE');
    expect(rig.seqs).toEqual([...new Set(rig.seqs)].sort((a, b) => a - b));
    expect(rig.seqs.at(-1)).toBe(rig.seq);
  });

  it('claims nothing by what stands there: it may be years old', () => {
    const rig = new Rig();
    rig.hear('put', '/', rig.node());
    expect(rig.twin.state).not.toBeNull();
    expect(rig.verdict.word).not.toBe('LIVE');
    rig.pass(2750);
    expect(rig.verdict).toMatchObject({ word: 'STALE', cause: 'relay degraded', ageMs: null });
    rig.pass(20_000);
    expect(rig.verdict).toMatchObject({ word: 'STALE', cause: 'relay degraded' });
    expect(rig.session.phase, 'and is no dead connection').toBe('open');
    rig.write();
    expect(rig.verdict.word).toBe('LIVE');
  });

  it('that nobody writes any more is stale within two seconds, and its age is known', () => {
    const rig = live();
    rig.pass(2000);
    expect(rig.verdict).toMatchObject({ word: 'STALE', cause: 'relay degraded' });
    expect(rig.verdict.ageMs).toBeGreaterThan(1500);
    expect(rig.reader.doubtful(rig.now)).toBe(false);
    rig.pass(7000);
    expect(rig.verdict).toMatchObject({ word: 'STALE', cause: 'relay degraded' });
    expect(rig.reader.doubtful(rig.now), 'another connection tells').toBe(true);
    expect(SILENT_LIMIT_MS).toBeLessThan(7000);
  });

  it('hands the words of the relay on: silent, offline', () => {
    const rig = live();
    for (let turn = 0; turn < 4; turn++) {
      rig.pass(900);
      rig.hear('put', '/status', rig.status({ robot: 'silent', age_ms: 2000 + turn * 900 }));
      expect(rig.verdict).toMatchObject({ word: 'STALE', cause: 'robot silent' });
    }
    rig.pass(500);
    rig.hear('patch', '/status', { robot: 'offline', age_ms: 6000, at: rig.at });
    expect(rig.verdict.word).toBe('OFFLINE');
  });

  it('without a node is a robot that is not on air, also while somebody looks', () => {
    const rig = new Rig();
    rig.hear('put', '/', null);
    expect(rig.verdict.word).toBe('OFFLINE');
    rig.pass(30_000);
    expect(rig.verdict.word).toBe('OFFLINE');
    rig.hear('put', '/', rig.node());
    expect(rig.verdict.word).toBe('LIVE');
    rig.hear('put', '/', null);
    rig.pass(5000);
    expect(rig.verdict.word).toBe('OFFLINE');
    expect(rig.session.phase).toBe('open');
  });

  it('reads a change that comes child by child', () => {
    const rig = live();
    rig.pass(500);
    rig.hear('put', '/key', rig.frame(true));
    rig.hear('put', '/frame', rig.frame());
    rig.hear('put', '/status/at', rig.at);
    expect(rig.twin.state?.seq).toBe(rig.seq);
    expect(rig.verdict.word).toBe('LIVE');
  });

  it('knows what lay on its way for long, and takes a clock that was set back for none', () => {
    const rig = live();
    rig.at -= 3_600_000;
    rig.pass(500);
    rig.write();
    expect(rig.verdict.word).toBe('LIVE');
    rig.pass(500);
    rig.write({ at: rig.at - 2500 }); // written then
    expect(rig.verdict.ageMs).toBeGreaterThan(0);
    rig.pass(500);
    rig.write();
    expect(rig.verdict.word).toBe('LIVE');
  });

  it('ends when it may no longer be read', () => {
    const reader = new MirrorReader(WIRE_VERSION);
    expect(reader.read(0, { name: 'cancel', data: '"Permission denied"' })).toBe(4403);
    expect(reader.read(0, { name: 'auth_revoked', data: '"x"' })).toBe(4403);
    const session = new Session(URL_, 30, true, () => 0.5);
    session.start(0);
    session.opened(0);
    session.closed(10, 4403, '');
    expect(session.phase).toBe('ended');
  });

  it('may hold anything, and is read as far as it goes', () => {
    const odd = [
      null,
      7,
      'x',
      [],
      {},
      { path: 7, data: null },
      { path: '/', data: [1] },
      { path: '/frame', data: {} },
    ];
    const reader = new MirrorReader(WIRE_VERSION);
    for (const data of odd) {
      for (const name of ['put', 'patch', 'keep-alive', 'x']) {
        expect(Array.isArray(reader.read(0, { name, data: JSON.stringify(data) }))).toBe(true);
      }
    }
    const bad = { schema: '%%%', key: '%%%', frame: 'AAAA', status: { robot: 7, at: 'x' } };
    const rig = new Rig();
    rig.hear('put', '/', bad);
    rig.hear('patch', '/', {
      __proto__: 'x',
      schema: '/w==',
      status: { robot: 'online', at: 5, age_ms: 'x' },
    });
    rig.hear('put', '/constructor/prototype/x', 'x');
    expect(({} as { x?: unknown }).x).toBeUndefined();
    expect(rig.twin.state).toBeNull();
    rig.hear('put', '/', rig.node());
    expect(rig.twin.state).not.toBeNull();
  });
});
