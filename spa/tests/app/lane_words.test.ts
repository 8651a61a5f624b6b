import { describe, expect, it } from 'vitest';
import english from '../../src/app/explain/en.json';
import hangul from '../../src/app/explain/ko.json';
import { announcement } from '../../src/app/robot/announcement.ts';
import { explanationWords } from '../../src/app/robot/Explanation.tsx';
import { sharedLink } from '../../src/app/share/ShareSheet.tsx';
import { ko } from '../../src/app/text/ko.ts';
import { moreKo } from '../../src/app/text/more_ko.ts';
import { behindWords, chipWords, stageWords } from '../../src/app/words/status.ts';
import { type Link, steadyBehindMs } from '../../src/stream/client.ts';
import type { Verdict } from '../../src/twin/liveness.ts';

const IN_LANE: Link = {
  ...{ by: 'segments', phase: 'open', retryAtMs: null, ending: null, grantedHz: 30, rateReason: null },
  ...{ hz: 29.8, roundTripMs: null, lateMs: null, behindMs: 4300, problem: null },
};
const DELAYED: Link = { ...IN_LANE, by: 'websocket', roundTripMs: 42, lateMs: 42, behindMs: 30_000 };
const LIVE: Verdict = {
  ...{ word: 'LIVE', cause: null, overShare: false, ageMs: 30, linkMs: 30, unchangedMs: 0, past: null },
};
const OVERDUE: Verdict = { ...LIVE, word: 'STALE', cause: 'waiting for the next part', ageMs: 3200 };

const chip = (changed: Partial<Verdict> = {}, link = IN_LANE) => {
  const { word, detail, more, behind, warning } = chipWords({ ...LIVE, ...changed }, link, 0);
  return [`${word} ${detail}${more}`.trim(), behind, warning].filter((part) => part !== '').join(' | ');
};

describe('what is shown behind now', () => {
  it('is said beside the word, apart from what narrow screens leave out', () => {
    expect(chip()).toBe('LIVE 30 Hz | 4 s behind');
    expect(chip({ word: 'HOLDING', unchangedMs: 12_000 })).toBe('HOLDING 12 s | 4 s behind');
    expect(chip({}, DELAYED), 'and not how long the last metre takes').toBe('LIVE 30 Hz | 30 s behind');
    expect(chip({}, { ...DELAYED, behindMs: 300_000 })).toBe('LIVE 30 Hz | 5 min behind');
    expect(chip({}, { ...DELAYED, by: 'events' })).toBe('LIVE 30 Hz · over HTTP | 30 s behind');
    expect(chip({ overShare: true }, DELAYED)).toBe('LIVE 30 Hz | 30 s behind | robot sends too much');
    expect(chip({}, { ...DELAYED, behindMs: 200 }), 'never none').toBe('LIVE 30 Hz | 1 s behind');
  });

  it('is said of STALE and OFFLINE as well, which would else be read as now', () => {
    for (const cause of ['robot silent', 'relay degraded', 'waiting for the next part'] as const)
      expect(chipWords({ ...LIVE, word: 'STALE', cause }, IN_LANE, 0).behind, cause).toBe('4 s behind');
    expect(chipWords({ ...LIVE, word: 'OFFLINE' }, IN_LANE, 0).behind).toBe('4 s behind');
  });

  it('is said of no word of another time, and of a lost connection as the window’s title says it', () => {
    for (const word of [null, 'PAST', 'RECORDED'] as const)
      expect(chipWords({ ...LIVE, word }, IN_LANE, 0).behind, String(word)).toBe('');
    const unconnected = { ...LIVE, word: 'STALE', cause: 'no connection', ageMs: 3100 } as const;
    expect(chip(unconnected)).toBe('STALE 3.1 s: no connection | 4 s behind');
    expect(chipWords(unconnected, IN_LANE, 0).behind).toBe(behindWords(4300, 'STALE'));
    expect(chipWords(LIVE, { ...IN_LANE, behindMs: null }, 0).behind).toBe('');
  });

  it('is told by whole seconds that do not go to and fro', () => {
    let told: number | null = null;
    const words = [4380, 4520, 4490, 4610, 3300, 4400, 4760, 4400, 4240].map((ms) => {
      told = steadyBehindMs(told, ms);
      return chipWords(LIVE, { ...IN_LANE, behindMs: told }, 0).behind;
    });
    expect(words).toEqual([...Array<string>(6).fill('4 s behind'), '5 s behind', '5 s behind', '4 s behind']);
    expect(steadyBehindMs(told, null), 'a socket').toBeNull();
    expect(steadyBehindMs(null, 30_000)).toBe(30_000);
  });

  it('is explained: why, how far, and that nothing need be done', () => {
    const lines = (link: Link, isLaneChosen?: boolean) =>
      explanationWords(LIVE, link, isLaneChosen).join(' ');
    const full =
      /All places are taken, so you see the robot 4 s late. The page asks for a place from time to time/;
    expect(lines(IN_LANE)).toMatch(full);
    expect(lines(IN_LANE, true)).not.toMatch(full);
    expect(lines(IN_LANE, true)).toMatch(/shows the robot 4 s late, so that any number of people can watch/);
    expect(lines(IN_LANE), 'a cache may have answered').not.toMatch(/Relay: last message/);
    expect(lines(DELAYED)).toMatch(/shows it 30 s late/);
    expect(lines(DELAYED)).toMatch(/Relay: last message/);
    expect(lines({ ...DELAYED, behindMs: null })).not.toMatch(/late|later|behind/);
    for (const { words } of [english, hangul]) expect(words.BEHIND.what).not.toBe('');
    const korean = [moreKo.explainFull, moreKo.explainCached, moreKo.explainDelayed].map((say) => say('4초'));
    for (const said of [...korean, ko.behind('4초')]) expect(said).toContain('4초');
  });

  it('is read aloud once, whatever the seconds', () => {
    const said = (behindMs: number | null, verdict = LIVE) =>
      announcement({ name: 'demo', verdict, behindMs, readings: null, faults: [] });
    expect(said(4300).text).toBe('demo: live, 4 s behind');
    expect(said(5300).gist).toBe(said(4300).gist);
    expect(said(null).gist).not.toBe(said(4300).gist);
    expect(said(null).text).toBe('demo: live');
    expect(said(4300, OVERDUE).text).toBe('demo: stale, 4 s behind, waiting for the next part');
  });
});

describe('a part that is overdue', () => {
  it('is the reason for STALE, in the chip, over the body and in the explanation', () => {
    expect(chip(OVERDUE)).toBe('STALE 3.2 s: waiting for the next part | 4 s behind');
    expect(stageWords(OVERDUE, IN_LANE, 0)).toBe('Stale for 3.2 s: waiting for the next part.');
    expect(explanationWords(OVERDUE, IN_LANE)[0]).toMatch(/next part of the stream is late/);
  });
});

it('a picture that only the page was slow to show is stale, and nobody is blamed', () => {
  const late: Verdict = { ...LIVE, word: 'STALE', ageMs: 2100 };
  expect(chip(late)).toBe('STALE 2.1 s | 4 s behind');
  expect(stageWords(late, IN_LANE, 0)).toBe('Stale for 2.1 s.');
});

describe('a link', () => {
  it('that is shared leaves out how this page reads the robot, and nothing else', () => {
    const at = (search: string) => sharedLink(`https://a.example/x/${search}#/r/demo?joint=RKN`, null);
    expect(at('')).toBe('https://a.example/x/#/r/demo?joint=RKN');
    expect(at('?lane=segments')).toBe('https://a.example/x/#/r/demo?joint=RKN');
    const kept = '?relay=https://r.example&as=anyone';
    expect(at(`${kept}&lane=segments`)).toBe(`https://a.example/x/${kept}#/r/demo?joint=RKN`);
    expect(sharedLink('https://a.example/?lane=segments&lang=ko#/r/demo', 'https://a.example/r/demo')).toBe(
      'https://a.example/r/demo?lang=ko#/r/demo',
    );
  });
});
