import { describe, expect, it } from 'vitest';
import { inOrder, judgeListed, readPublishAt, readRobots } from '../../src/app/pages/list/robots.ts';
import { announcement } from '../../src/app/robot/announcement.ts';
import { missingWords } from '../../src/app/robot/BodyNotes.tsx';
import { explanationWords } from '../../src/app/robot/Explanation.tsx';
import { heightPx, nextHeight, PEEK_PX, restingHeight } from '../../src/app/shell/Sheet.tsx';
import { hashAtPath, hashOfPath, parseRoute } from '../../src/app/state/address.ts';
import { readSettings } from '../../src/app/state/settings.ts';
import { en } from '../../src/app/text/en.ts';
import { ko } from '../../src/app/text/ko.ts';
import { moreEn } from '../../src/app/text/more_en.ts';
import { chipWords, stageWords, waitingWords } from '../../src/app/words/status.ts';
import type { Link } from '../../src/stream/client.ts';
import type { Verdict } from '../../src/twin/liveness.ts';

describe('routes', () => {
  it('are the list, a robot, or nothing we know', () => {
    expect(['', '#', '#/'].map((hash) => parseRoute(hash).page)).toEqual(['list', 'list', 'list']);
    expect(parseRoute('#/r/hubo-2')).toEqual({ page: 'robot', robot: 'hubo-2' });
    expect(parseRoute('#/r/demo?view=public')).toEqual({ page: 'robot', robot: 'demo' });
    expect(parseRoute('#/r/demo+hubo')).toEqual({ page: 'robots', robots: ['demo', 'hubo'] });
    expect(parseRoute('#/r/demo+demo')).toEqual({ page: 'robot', robot: 'demo' });
    expect(parseRoute('#/r/a+b+c+d+e+f').page).toBe('robots');
    expect(parseRoute('#/r/a+b+c+d+e+f+g').page).toBe('unknown');
    expect(parseRoute('#/r/demo+').page).toBe('unknown');
    for (const bad of ['#/r/', '#/r/*', '#/r/Hubo', '#/r/a/b', '#/r/../x', `#/r/${'a'.repeat(64)}`, '#/x']) {
      expect(parseRoute(bad).page).toBe('unknown');
    }
  });
});

describe('a path below the page', () => {
  it('names what the same hash names', () => {
    const page = (path: string) => parseRoute(hashOfPath(path));
    expect(page('r/demo')).toEqual({ page: 'robot', robot: 'demo' });
    expect(page('r/demo/')).toEqual({ page: 'robot', robot: 'demo' });
    expect(page('r/a%2Bb')).toEqual({ page: 'robots', robots: ['a', 'b'] });
    expect(page('')).toEqual({ page: 'list' });
    expect(page('demo')).toEqual({ page: 'unknown', hash: '/demo' });
    expect(page('%3Cscript%3E').page).toBe('unknown');
  });

  it('wins over a hash that names another robot, and over nothing else that the hash says', () => {
    const demo = hashOfPath('r/demo');
    expect(['', '#'].map((hash) => hashAtPath(demo, hash))).toEqual([demo, demo]);
    expect(hashAtPath(demo, '#/r/other')).toBe('#/r/demo');
    expect(hashAtPath(demo, '#/r/other?camera=1,2&shown=both?')).toBe('#/r/demo?camera=1,2&shown=both?');
    expect(hashAtPath(demo, '#/r/demo+other')).toBe('#/r/demo');
    expect(hashAtPath(hashOfPath('r/a%2Bb'), '#/r/b?x')).toBe('#/r/a+b?x');
    for (const kept of [
      '#/r/demo?camera=1,2',
      '#/r/demo',
      '#/r/demo/',
      '#/r/demo+demo',
      '#/',
      '#/typo',
      '#/r/Hubo',
    ]) {
      expect(hashAtPath(demo, kept)).toBe(kept);
    }
    expect(hashAtPath(hashOfPath(''), '#/r/other')).toBe('#/r/other');
    expect(hashAtPath(hashOfPath('typo'), '#/r/other?x')).toBe('#/r/other?x');
  });
});

describe('settings', () => {
  it('come out whole whatever storage holds', () => {
    const whole = readSettings(null);
    expect(whole).toMatchObject({ theme: 'system', angle: 'rad', shown: 'pos', panelPx: null });
    for (const odd of ['', 'nonsense', '[]', '7', '{"theme":"pink","panelPx":"wide","panelOpen":1}']) {
      expect(readSettings(odd)).toEqual(whole);
    }
    expect(readSettings('{"theme":"light","panelPx":420,"unknown":1}')).toEqual({
      ...whole,
      theme: 'light',
      panelPx: 420,
    });
  });
});

describe('the list of robots', () => {
  it('is read with care', () => {
    const robots = readRobots({
      robots: [
        { robot: 'demo', status: 'online', age_ms: 12, seq: 4, hz: 30, viewers: 3, model: null },
        { robot: 'old', status: 'offline', age_ms: null, viewers: 0, model: '../x' },
        { status: 'online' },
        null,
      ],
    });
    expect(robots).toEqual([
      { robot: 'demo', name: 'demo', state: 'online', ageMs: 12, viewers: 3, model: null },
      { robot: 'old', name: 'old', state: 'offline', ageMs: null, viewers: 0, model: null },
    ]);
    expect([null, {}, 'x', { robots: 7 }].map(readRobots)).toEqual([[], [], [], []]);
  });

  it('calls no robot LIVE by an answer that took long', () => {
    const robots = readRobots({
      robots: [
        { robot: 'demo', status: 'online', age_ms: 12 },
        { robot: 'veiled', status: 'online', age_ms: null },
        { robot: 'quiet', status: 'silent', age_ms: 5000 },
        { robot: 'old', status: 'offline', age_ms: 90_000 },
      ],
    });
    const judged = (tookMs: number) => {
      const verdicts = robots.map((robot) => judgeListed(robot, tookMs));
      return verdicts.map(({ word, cause, ageMs }) => [word, cause, ageMs]);
    };
    expect(judged(600)).toEqual([
      ['LIVE', null, 612],
      ['LIVE', null, 600],
      ['STALE', 'robot silent', 5600],
      ['OFFLINE', null, 90_600],
    ]);
    expect(judged(4000).map(([word, cause]) => cause ?? word)).toEqual([
      ...['slow network', 'slow network', 'robot silent', 'OFFLINE'],
    ]);
  });
});

describe('where a robot may be published', () => {
  it('is named in a command only where it is this computer', () => {
    expect(readPublishAt({ publish_at: 'tcp/127.0.0.1:7450' })).toBe('tcp/127.0.0.1:7450');
    for (const odd of ['tcp/evil.example:1', 'tcp/127.0.0.1:1; rm -r x', 7447, null])
      expect(readPublishAt({ publish_at: odd })).toBe(null);
    expect([{}, [], null].map(readPublishAt)).toEqual([null, null, null]);
  });
});

describe('who stands under "On air"', () => {
  it('are those whose edge is there, those that move first; the others stand below, the last to leave first', () => {
    const robots = readRobots([
      { robot: 'long-gone', status: 'offline', age_ms: 90_000 },
      { robot: 'b', status: 'online', age_ms: 10 },
      { robot: 'mute', status: 'silent', age_ms: 9000 },
      { robot: 'never', status: 'offline', age_ms: null },
      { robot: 'a', status: 'online', age_ms: 30 },
      { robot: 'gone', status: 'offline', age_ms: 4000 },
    ]);
    const names = inOrder(robots).map((some) => some.map(({ robot }) => robot));
    expect(names).toEqual([
      ['a', 'b', 'mute'],
      ['gone', 'long-gone', 'never'],
    ]);
  });
});

describe('the sheet', () => {
  const room = 700;

  it('has three heights', () => {
    expect(heightPx('peek', room)).toBe(PEEK_PX);
    expect(heightPx('half', room)).toBe(294);
    expect(heightPx('half', 172), 'the tabs and a row').toBe(168);
    expect(heightPx('half', 100)).toBe(100);
    expect(heightPx('full', room)).toBe(room);
  });

  it('comes to rest at the nearest, or where a flick sends it', () => {
    expect(restingHeight(300, 0, room)).toBe('half');
    expect(restingHeight(600, 0.1, room)).toBe('full');
    expect(restingHeight(120, 0, room)).toBe('peek');
    expect(restingHeight(150, 1, room)).toBe('half');
    expect(restingHeight(400, 1, room)).toBe('full');
    expect(restingHeight(500, -1, room)).toBe('half');
    expect(restingHeight(290, -1, room)).toBe('peek');
  });

  it('goes on to the next when tapped', () => {
    expect((['peek', 'half', 'full'] as const).map(nextHeight)).toEqual(['half', 'full', 'peek']);
  });
});

describe('words', () => {
  const link: Link = {
    by: 'websocket',
    phase: 'open',
    retryAtMs: null,
    ending: null,
    grantedHz: 30,
    rateReason: null,
    hz: 29.8,
    roundTripMs: 42,
    lateMs: 41,
    behindMs: null,
    problem: null,
  };
  const verdict = (changed: Partial<Verdict>): Verdict => ({
    word: 'LIVE',
    cause: null,
    overShare: false,
    ageMs: 3200,
    linkMs: 400,
    past: null,
    unchangedMs: 12_000,
    ...changed,
  });
  const chip = (changed: Partial<Verdict>, now = 0) => {
    const { word, detail, more, warning } = chipWords(verdict(changed), link, now);
    return `${word} ${detail}${more} ${warning}`.trim();
  };

  it('of the chip', () => {
    const at = new Date(2026, 10, 21, 14, 2, 3).getTime();
    expect(chip({})).toBe('LIVE 30 Hz · 58 ms');
    expect(chip({ word: 'HOLDING' })).toBe('HOLDING 12 s');
    expect(chip({ word: 'STALE', cause: 'robot silent' })).toBe('STALE 3.2 s: robot silent');
    expect(chip({ word: 'STALE', cause: 'slow network' })).toBe('STALE 3.2 s: slow network');
    expect(chip({ word: 'STALE', cause: 'busy browser' })).toBe('STALE 3.2 s: this browser is busy');
    expect(chip({ word: 'STALE', cause: 'no connection', ageMs: null })).toBe('STALE no connection');
    const refused = (code: number, ageMs: number | null = null) => {
      const ended = { ...link, phase: 'ended', ending: { code, reason: '' } } as const;
      const verdictNow = verdict({ word: 'STALE', cause: 'no connection', ageMs });
      const { word, detail, more } = chipWords(verdictNow, ended, 0);
      return [`${word} ${detail}${more}`.trim(), stageWords(verdictNow, ended, 0)];
    };
    expect(refused(4404)).toEqual(['no such robot', en.endedAbsent]);
    expect(refused(4403)).toEqual(['not shared', en.endedForbidden]);
    expect(refused(4401, 3200)).toEqual(['STALE 3.2 s: sign-in needed', en.endedToken]);
    expect(refused(1013)).toEqual(['relay full', en.endedFull]);
    expect(refused(1006)).toEqual(['no connection', en.endedLost]);
    expect(chip({ word: 'OFFLINE' }, at + 3200)).toBe('OFFLINE since 14:02');
    expect(chip({ word: 'OFFLINE', ageMs: null })).toBe('OFFLINE');
    expect(chip({ word: null })).toBe('Connecting');
  });

  it('of a robot that sends too much, whatever its word, behind the chip, and spoken', () => {
    expect(chip({ overShare: true })).toBe('LIVE 30 Hz · 58 ms robot sends too much');
    expect(chip({ overShare: true, word: 'HOLDING' })).toBe('HOLDING 12 s robot sends too much');
    expect(ko.overShare).toBe('로봇이 너무 많이 보냄');
    const why = /more than its share/;
    expect(explanationWords(verdict({ overShare: true }), link).join(' ')).toMatch(why);
    expect(explanationWords(verdict({}), link).join(' ')).not.toMatch(why);
    const said = (overShare: boolean) =>
      announcement({ name: 'demo', verdict: verdict({ overShare }), readings: null, faults: [] });
    expect(said(true).text).toBe('demo: live, robot sends too much');
    expect(said(false).gist, 'worth saying that it is over').not.toBe(said(true).gist);
  });

  it('over the body, only when the picture is not the present', () => {
    const stage = (changed: Partial<Verdict>, of: Partial<Link> = {}) =>
      stageWords(verdict(changed), { ...link, ...of }, 1000);
    expect(stage({})).toBeNull();
    expect(stage({ word: 'HOLDING' })).toBeNull();
    expect(stage({ word: 'STALE', cause: 'robot silent' })).toBe('Stale for 3.2 s: robot silent.');
    const lost = { word: 'STALE', cause: 'no connection' } as const;
    expect(stage(lost, { phase: 'waiting', retryAtMs: 4200, ending: { code: 1006, reason: '' } })).toBe(
      'No connection. Trying again in 4 s.',
    );
    expect(stage(lost, { phase: 'waiting', retryAtMs: 13_000, ending: { code: 1013, reason: '' } })).toBe(
      'The relay is full. Trying again in 12 s.',
    );
    expect(stage(lost, { phase: 'connecting' })).toBe('No connection. Trying again.');
    expect(stage(lost, { phase: 'ended', ending: { code: 4403, reason: '' } })).toBe(
      'This robot is not shared with you.',
    );
  });

  it('say that data is late, not that nothing comes', () => {
    const slow = { word: 'STALE', cause: 'slow network' } as const;
    expect(stageWords(verdict(slow), link, 0)).toBe('Stale for 3.2 s: slow network.');
    expect(explanationWords(verdict(slow), link)[0]).toBe(moreEn.explainSlow);
    expect(announcement({ name: 'demo', verdict: verdict(slow), readings: null, faults: [] }).text).toBe(
      'demo: stale, slow network',
    );
  });

  it('behind the chip name a lowered rate and its reason', () => {
    const lines = explanationWords(verdict({}), { ...link, grantedHz: 5, rateReason: 'slow network' });
    expect(lines).toContain('5 Hz: slow network.');
    expect(lines).toContain('Round trip to the relay: 42 ms.');
  });

  it('say quietly that no WebSocket gets through', () => {
    const events: Link = { ...link, by: 'events', roundTripMs: null };
    const { word, detail, more } = chipWords(verdict({}), events, 0);
    expect(`${word} ${detail}${more}`).toBe('LIVE 30 Hz · 58 ms · over HTTP');
    expect(chipWords(verdict({}), { ...events, lateMs: null }, 0).more).toBe(' · over HTTP');
    expect(explanationWords(verdict({}), events).join(' ')).toMatch(/WebSocket does not work/);
    expect(explanationWords(verdict({}), link).join(' ')).not.toMatch(/WebSocket/);
  });

  it('say that a mirror is one, and that nobody writes it', () => {
    const mirror: Link = { ...link, by: 'mirror', hz: 2, roundTripMs: null };
    const { word, detail, more } = chipWords(verdict({}), mirror, 0);
    expect(`${word} ${detail}${more}`).toBe('LIVE 2 Hz · mirror');
    expect(explanationWords(verdict({}), mirror).join(' ')).toMatch(
      /reads a mirror.* at most 2 poses a second/,
    );
    const unwritten = explanationWords(verdict({ word: 'STALE', cause: 'relay degraded' }), mirror);
    expect(unwritten[0]).toMatch(/^The mirror is not being updated/);
  });

  it('of waiting name what is missing', () => {
    const all = { phase: 'open', schema: true, pose: true } as const;
    const words = [
      { ...all, phase: 'connecting' as const },
      { ...all, schema: false },
      { ...all, pose: false },
      all,
    ].map(waitingWords);
    expect(new Set(words).size).toBe(4);
    expect(words[0]).toBe('Waiting for the relay.');
  });

  it('of missing meshes name them', () => {
    const two = ['package://hubo/meshes/Body_RWP.stl', 'package://hubo/meshes/Body_Head.stl'];
    expect(missingWords(two, 57)).toBe('2 of 57 meshes are missing: Body_RWP, Body_Head.');
    expect(missingWords(two.slice(0, 1), null)).toBe('1 mesh is missing: Body_RWP.');
  });
});
