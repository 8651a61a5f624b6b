import { parseSchema } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { readRobots } from '../../src/app/pages/list/robots.ts';
import { announcement } from '../../src/app/robot/announcement.ts';
import { missingWords, unreadWords } from '../../src/app/robot/BodyNotes.tsx';
import { problemWords } from '../../src/app/words/status.ts';
import { displayOf, flagWords } from '../../src/twin/format.ts';
import { isolated, plainName, wordsOfName } from '../../src/twin/names.ts';
import { traceReading } from '../../src/twin/plots/trace.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { SensorTable } from '../../src/twin/sensors/sensors.ts';
import { WrenchTable } from '../../src/twin/sensors/wrenches.ts';
import { SCHEMA, SCHEMA_TEXT, schemaWith } from '../rigs/schema.ts';

/** Reverses what follows; invisible; left to right again, over and over. */
const ODD = 'RKN\u202e\u200b\u2069\u2069';
const ODD_SHOWN = 'RKN\\u{202e}\\u{200b}\\u{2069}\\u{2069}';
const HEBREW = '\u05d0\u05d1\u05d2 1';
const HEBREW_SHOWN = `\u2068${HEBREW}\u2069`;

describe('a name from outside', () => {
  it('is shown as it is, in whatever letters', () => {
    for (const name of ['RKN', 'right knee', 'Übung 2', '오른 무릎', '膝（右）', 'm/s²', '°C', '🦿', '']) {
      expect(isolated(name)).toBe(name);
    }
  });

  it('looks like no other: what is unseen is made visible', () => {
    const names = [
      'a',
      'a\u200b',
      'a\u202e',
      'a\0',
      'a\x1f',
      'a\x7f',
      'a\u00ad',
      'a\u3164',
      'a\u00a0',
      'a\ufe0f',
      'a\n',
    ];
    expect(new Set(names.map(isolated)).size).toBe(names.length);
    for (const name of names) expect(isolated(name)).toMatch(/^a(\\u\{[0-9a-f]+\})?$/);
  });

  it('keeps the joiners and marks of its script', () => {
    expect(isolated('نیم\u200cساق')).toBe('\u2068نیم\u200cساق\u2069');
    expect(isolated('ශ්\u200dරී')).toBe('ශ්\u200dරී');
    expect(isolated('אב B\u200f'), 'whose direction is its own').toBe('\u2068אב B\u200f\u2069');
    expect(isolated('B\u200f'), 'which has none to mark').toBe('B\\u{200f}');
  });

  it('turns no neighbour: its direction is its own', () => {
    expect(isolated(HEBREW)).toBe(HEBREW_SHOWN);
    expect(isolated('\u202eabc')).toBe('\\u{202e}abc');
    expect(isolated(`${HEBREW}\u2069\u202e`), 'nor gets out of it').toBe(
      `\u2068${HEBREW}\\u{2069}\\u{202e}\u2069`,
    );
  });
});

describe('wherever one is shown', () => {
  const sensors = { [ODD]: { kind: 'wrench', name: HEBREW, link: 'hand' } };
  const schema = schemaWith(
    { joint: [ODD, HEBREW], site: [`${ODD}.fx`, `${ODD}.fy`, `${ODD}.fz`], power: [HEBREW] },
    [
      { name: 'pos', labels: 'joint', unit: HEBREW },
      { name: 'flags', labels: 'joint', bits: [ODD, `\u202e spaced`] },
      { name: 'ftf', labels: 'site' },
      { name: 'volt', labels: 'power' },
    ],
    { robot: ODD, mapping: { names: { [ODD]: HEBREW }, sensors } },
  );
  const twin = new RobotTwin('demo', 0);

  it('robots', () => {
    expect(twin.name).toBe('demo');
    twin.acceptSchema(schema);
    expect(twin.name).toBe(ODD_SHOWN);
    const listed = readRobots({
      robots: [
        { robot: 'demo', name: HEBREW },
        { robot: 'demo', name: ODD },
      ],
    });
    expect(listed.map(({ name }) => name)).toEqual([HEBREW_SHOWN, ODD_SHOWN]);
  });

  it('joints, flags and units', () => {
    expect(plainName(schema, ODD, 'ko')).toBe(HEBREW_SHOWN);
    expect(plainName(schema, 'none', 'en')).toBeUndefined();
    expect(flagWords('pwmSaturated\u200b')).toBe('PWM saturated\\u{200b}');
    expect(flagWords('\u202e spaced')).toBe('\\u{202e} spaced');
    expect(displayOf(HEBREW, 'rad').unit).toBe(HEBREW_SHOWN);
    expect(traceReading(schema, { field: 'pos', label: ODD })?.title).toBe(`${ODD_SHOWN} pos`);
    expect(unreadWords([ODD, HEBREW])).toContain(`${ODD_SHOWN}, ${HEBREW_SHOWN}: shown`);
  });

  it('sensors', () => {
    const { groups } = new SensorTable(schema);
    expect(groups.map(({ title }) => title)).toEqual([HEBREW_SHOWN, `Power, ${HEBREW_SHOWN}`]);
    expect(new WrenchTable(schema).wrenches.map(({ name }) => name)).toEqual([HEBREW_SHOWN]);
  });

  it('sentences', () => {
    const fault = { key: 'k', level: 'fault', what: 'temp', source: ODD, words: '', firstMs: 0 } as const;
    const told = announcement({
      name: twin.name,
      verdict: { word: 'LIVE', cause: null, overShare: false },
      readings: null,
      faults: [{ ...fault, clearedMs: null, acknowledged: false }],
    });
    expect(told.text).toBe(`${ODD_SHOWN}: live; ${ODD_SHOWN}: too hot`);
    expect(missingWords([`meshes/${HEBREW}.stl`], 1)).toBe(`1 of 1 meshes is missing: ${HEBREW_SHOWN}.`);
    expect(problemWords({ what: 'worker', detail: 'a\u202e' })).toContain('a\\u{202e}');
  });
});

it('is what the profile says, else the words that the name is made of', () => {
  const names = [
    'RKN',
    'LKN',
    'left_hip_pitch_joint',
    'leftHipPitch',
    'Left_Knee',
    'panda_joint1',
    'LF_HAA',
    'j1',
  ];
  expect(names.map((label) => wordsOfName(SCHEMA, label, 'en'))).toEqual([
    'right knee',
    null,
    'left hip pitch',
    'left hip pitch',
    'left knee',
    'panda joint1',
    null,
    null,
  ]);
});

it('is in the language of who reads it, if the profile has that', () => {
  const doc = JSON.parse(SCHEMA_TEXT);
  const mapping = { ...doc.mapping, translated_names: { ko: { RKN: '오른쪽 무릎' } } };
  const schema = parseSchema(JSON.stringify({ ...doc, mapping }));
  expect(wordsOfName(schema, 'RKN', 'ko')).toBe('오른쪽 무릎');
  expect(wordsOfName(schema, 'RKN', 'en')).toBe('right knee');
  expect(wordsOfName(schema, 'left_hip_joint', 'ko')).toBe('left hip');
});
