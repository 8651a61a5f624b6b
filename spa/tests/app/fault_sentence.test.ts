// @vitest-environment happy-dom
import { parseSchema } from '@posecast/wire';
import { afterEach, expect, it, vi } from 'vitest';
import { changeSettings } from '../../src/app/state/settings.ts';
import { bindLanguage, korean } from '../../src/app/text/language.ts';
import { faultSentence, timesWords } from '../../src/app/words/fault_sentence.ts';
import { FaultLog } from '../../src/twin/alarms/fault_log.ts';
import { fillSentence, sentenceOf } from '../../src/twin/alarms/sentence.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { codesWith, SCHEMA_TEXT, stateOf } from '../rigs/schema.ts';

const AT_MS = 1_800_000_000_000;
const JAM = 7; // also homed and enabled
const TOLD = {
  flags: {
    jam: {
      en: { say: '{joint} is blocked[: {error} off][ for {age}].', why: 'It hit something.' },
      ko: { say: '{joint}: 막힘[. {error} 벗어남].' },
    },
  },
};

afterEach(() => changeSettings({ language: 'en', angle: 'rad' }));

function watch(explain: object = TOLD, translated_names: object = {}) {
  const doc = JSON.parse(SCHEMA_TEXT);
  const schema = parseSchema(
    JSON.stringify({ ...doc, mapping: { ...doc.mapping, explain, translated_names } }),
  );
  const twin = new RobotTwin('small', 0);
  const log = new FaultLog();
  twin.acceptSchema(schema);
  const look = (ms: number, changed: Parameters<typeof codesWith>[0]) => {
    twin.acceptState(stateOf(codesWith(changed), { schemaId: schema.id, seq: ms }));
    log.rows(twin.joints()!.rows, AT_MS + ms);
  };
  const told = (ms: number) => faultSentence(twin, log, log.faults[0]!, AT_MS + ms);
  return { twin, log, look, told };
}

it('says what the profile says of a flag, by the plain name, and keeps the code and its word beside it', () => {
  const { look, told } = watch();
  look(0, { 'flags.RKN': JAM, 'ref.RKN': 500, 'pos.RKN': 100 });
  expect(told(500)).toEqual({
    said: 'Right knee is blocked: 0.40 rad off.',
    code: 'RKN',
    bit: 'jam',
    aged: false,
  });
  expect(told(14_000).said).toBe('Right knee is blocked: 0.40 rad off for 14 s.');
  changeSettings({ angle: 'deg' });
  expect(told(14_000).said).toMatch(/: 22\.9.* off for 14 s\.$/);
});

it('leaves out what is not known: a value without a reading, and all of them once it is over', () => {
  const { look, told } = watch();
  look(0, { 'flags.LKN': JAM, 'pos.LKN': null });
  expect(told(9000)).toEqual({ said: 'LKN is blocked for 9 s.', code: '', bit: 'jam', aged: true });
  look(9100, {});
  expect(told(9200)).toEqual({ said: 'Earlier: LKN is blocked.', code: '', bit: 'jam', aged: false });
});

it('tells which joint: by its code before a sentence that names none', () => {
  const { look, told } = watch({
    flags: { jam: { en: { say: 'Blocked[ for {age}][ by {joint}, {temp}].' } } },
  });
  look(0, { 'flags.LKN': JAM, 'temp.LKN': null });
  expect(told(9000)).toEqual({ said: 'LKN: Blocked for 9 s.', code: '', bit: 'jam', aged: true });
  look(9100, {});
  look(9200, { 'flags.RKN': JAM, 'temp.RKN': null });
  expect(told(9300)).toEqual({ said: 'Blocked.', code: 'RKN', bit: 'jam', aged: false });
});

it('has sentences of its own for limits, stalls and flags that nobody explained', () => {
  const { look, told } = watch({});
  look(0, { 'temp.RKN': 85 });
  expect(told(3000).said).toBe('Right knee is too hot: 85.0 °C.');
  look(100, {});
  const other = watch({});
  other.look(0, { 'flags.RKN': JAM });
  expect(other.told(3000).said).toBe('Right knee reports “jam” for 3 s.');
  const still = watch({});
  for (let ms = 0; ms <= 3000; ms += 1000) still.look(ms, { 'ref.RKN': 400 });
  expect(still.told(14_000)).toEqual({
    said: 'Right knee is not where it was told to be: 0.40 rad off for 14 s.',
    code: 'RKN',
    bit: null,
    aged: true,
  });
});

it('speaks the language of the page, or English', async () => {
  const { look, told, twin } = watch(TOLD, { ko: { RKN: '오른쪽 무릎' } });
  look(0, { 'flags.RKN': JAM, 'ref.RKN': 400 });
  changeSettings({ language: 'ko' });
  await bindLanguage();
  await vi.waitFor(() => expect(korean()).not.toBeNull());
  expect(told(500).said).toBe('오른쪽 무릎: 막힘. 0.40 rad 벗어남.');
  expect(sentenceOf(twin.schema, 'RKN', 'pwmSaturated', 'ko')).toBeNull();
  look(600, {});
  expect(told(700).said).toBe('지난 고장 — 오른쪽 무릎: 막힘.');
  changeSettings({ language: 'en' });
  await vi.waitFor(() => expect(korean()).toBeNull());
  expect(sentenceOf(twin.schema, 'RKN', 'jam', 'ko-KR')?.say).toMatch(/막힘/);
  expect(sentenceOf(twin.schema, 'RKN', 'jam', 'fr')?.why).toBe('It hit something.');
});

it('counts how often it rose', () => {
  const { look, log } = watch();
  for (const ms of [0, 10_000, 20_000]) {
    look(ms, { 'flags.RKN': JAM });
    look(ms + 2000, {});
  }
  expect(timesWords(log, log.faults[0]!, AT_MS + 30_000)).toBe('3rd time in 10 min');
  expect(timesWords(log, log.faults[0]!, AT_MS + 615_000)).toBe('');
});

it('takes whatever stands in a sentence, in time in proportion', () => {
  const known = (place: string) => (place === 'joint' ? 'a]{b}[c' : null);
  expect(fillSentence('{joint} [{joint}] [{x}]{x}{', known)).toBe('a]{b}[c a]{b}[c —{');
  expect(fillSentence('[[[{joint}', known)).toBe('[[[a]{b}[c');
  for (const hostile of ['['.repeat(200), '{'.repeat(200), '{a'.repeat(100), '[]'.repeat(100)])
    expect(fillSentence(hostile, known).length).toBeLessThanOrEqual(200);
});
