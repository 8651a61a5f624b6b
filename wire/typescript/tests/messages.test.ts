import fc from 'fast-check';
import { expect, test } from 'vitest';
import { parseRelayMessage } from '../src/index.ts';

const HASH = 'a'.repeat(64);

test.each([
  { type: 'status', robot: 'silent', age_ms: 1700, seq: 12, degraded: true, over_share: false, clock_ms: 7 },
  {
    type: 'status',
    robot: 'offline',
    age_ms: null,
    seq: null,
    degraded: false,
    over_share: true,
    clock_ms: null,
  },
  { type: 'event', n: 3, t: 1.5, at: 1e9, level: 'fault', source: 'RKN', text: 'jam', state: 'on' },
  { type: 'rate', hz: 10, reason: 'busy' },
  { type: 'model', hash: HASH },
  { type: 'pong', t: 5, clock_ms: 7 },
  { type: 'bye', code: 1012, reason: 'drain', retry_s: 8 },
  { type: 'bye', code: 1013, reason: 'full', retry_s: 30, lane: 'past/public' },
  { type: 'bye', code: 1013, reason: 'full', retry_s: null, lane: 'x'.repeat(300) },
])('reads $type', (message) => {
  expect(parseRelayMessage(JSON.stringify(message))).toEqual(message);
  expect(parseRelayMessage(JSON.stringify({ ...message, more: [1] }))).toEqual(message);
});

test('hello and info hold maps, so that no name is special', () => {
  const hello = { type: 'hello', wire: 1, server_time: 2, robot: 'r', view: 'public', hz: 10, model: null };
  expect(parseRelayMessage(JSON.stringify({ ...hello, limits: { max_hz: 30, x: 'y' } }))).toEqual({
    ...hello,
    limits: new Map([['max_hz', 30]]),
  });
  const info = parseRelayMessage('{"type":"info","kv":{"__proto__":"a","mode":"walking","n":1}}');
  expect(info).toEqual({
    type: 'info',
    kv: new Map([
      ['__proto__', 'a'],
      ['mode', 'walking'],
    ]),
  });
});

test('a schema keeps its exact text', () => {
  const text = '{ "type" : "schema", "v":1 }';
  expect(parseRelayMessage(text)).toEqual({ type: 'schema', text });
});

test.each([
  '',
  'null',
  '[]',
  '1',
  '{}',
  '{"type":1}',
  '{"type":"toString"}',
  '{"type":"__proto__"}',
  '{"type":"later"}',
  '{"type":"status","robot":"asleep","age_ms":1,"seq":1}',
  '{"type":"status","robot":"online","age_ms":"1","seq":1}',
  '{"type":"hello","wire":1}',
  '{"type":"info","kv":[]}',
  '{"type":"event","n":1,"t":1,"level":"fault","source":"RKN","text":"jam"}',
  '{"type":"model","hash":"../../etc"}',
  '{"type":"bye"}',
  '{"type":"pong","t":1e999}',
  '{"type":"pong","t":1e300}',
  '{"type":"pong","t":true}',
  `{"type":"pong","t":${'9'.repeat(5000)}}`,
  '{"type":"pong","t":1,"more":1e999}',
  '{"type":"event","n":1,"t":1e13,"level":"fault","source":"RKN","text":"jam","state":"on"}',
  '{"type":"event","n":1,"t":true,"level":"fault","source":"RKN","text":"jam","state":"on"}',
  '{"type":"event","n":1e999,"t":1,"level":"fault","source":"RKN","text":"jam","state":"on"}',
  '{"type":"event","n":1,"t":1,"level":"fault","source":"\\ud800","text":"jam","state":"on"}',
  '{"type":"info","kv":{"mode":"\\udc00"}}',
  '{"type":"info","kv":{"\\ud83d":"walking"}}',
  '\ufeff{"type":"pong","t":1}',
  `{"type":"pong","t":1,"more":${'['.repeat(63)}0${']'.repeat(63)}}`,
  `{"type":"pong","t":1,"more":${'['.repeat(100_000)}`,
])('skips %s', (text) => {
  expect(parseRelayMessage(text)).toBeNull();
});

test('a time that no calendar knows is none', () => {
  const text =
    '{"type":"event","n":1,"t":1,"at":1e13,"level":"fault","source":"RKN","text":"jam","state":"on"}';
  expect(parseRelayMessage(text)).toMatchObject({ n: 1, at: null });
});

test.each([null, 7, true, ['past/public'], { at: 'past/public' }, 'x'.repeat(301)])(
  'a lane %j is none',
  (lane) => {
    const bye = { type: 'bye', code: 1013, reason: 'full', retry_s: 30 };
    expect(parseRelayMessage(JSON.stringify({ ...bye, lane }))).toStrictEqual(bye);
  },
);

test('of a member named twice the last counts', () => {
  expect(parseRelayMessage('{"type":"bye","t":"x","type":"pong","t":-0.0}')).toEqual({
    type: 'pong',
    t: -0,
    clock_ms: null,
  });
});

test('never throws', () => {
  fc.assert(
    fc.property(
      fc.oneof(
        fc.string(),
        fc.json(),
        fc
          .constantFrom('hello', 'info', 'event')
          .chain((type) => fc.object().map((o) => JSON.stringify({ ...o, type }))),
      ),
      (text) => {
        parseRelayMessage(text);
      },
    ),
    { numRuns: 300 },
  );
});
