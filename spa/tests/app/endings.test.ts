import { ENDINGS, retryOf } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { en } from '../../src/app/text/en.ts';
import { ko } from '../../src/app/text/ko.ts';
import { endingWords } from '../../src/app/words/status.ts';
import { opened, Rig } from '../rigs/session_rig.ts';

describe('endings', () => {
  it('waits as long as a full hall asks', () => {
    const rig = opened();
    rig.say({ type: 'bye', code: 1013, reason: 'full', retry_s: 12 });
    rig.do(rig.session.closed(rig.now, 1013, ''));
    const [link] = rig.posts('link');
    expect(link).toMatchObject({ phase: 'waiting', ending: { code: 1013 } });
    expect((link?.retryAtMs ?? 0) - rig.now).toBe(12_000 + 250);
  });

  it('believes the bye and not the code that a proxy made of the ending', () => {
    const rig = opened();
    rig.say({ type: 'bye', code: 4403, reason: 'not shared', retry_s: null });
    rig.do(rig.session.closed(rig.now, 1006, ''));
    expect(rig.posts('link')).toMatchObject([
      { phase: 'ended', ending: { code: 4403, reason: 'not shared' } },
    ]);
    rig.pass(120_000);
    expect(rig.session.phase).toBe('ended');
  });

  it('comes back after an ending for good only when a person asks', () => {
    const rig = opened();
    rig.do(rig.session.closed(rig.now, 4403, ''));
    rig.pass(60_000);
    expect(rig.session.phase).toBe('ended');
    rig.do(rig.session.wake(rig.now));
    expect(rig.session.phase).toBe('connecting');
  });

  it('asks for an absent robot again and again, slowly and spread, whether or not it was ever there', () => {
    const there = opened();
    const never = new Rig();
    never.do(never.session.start(never.now));
    for (const rig of [there, never]) {
      for (let failure = 0; failure < 3; failure++) {
        rig.take();
        rig.do(rig.session.closed(rig.now, 4404, ''));
        const [link] = rig.posts('link');
        expect(link).toMatchObject({ phase: 'waiting', ending: { code: 4404 } });
        expect((link?.retryAtMs ?? 0) - rig.now).toBe(45_000);
        rig.pass(45_250);
        expect(rig.session.phase).toBe('connecting');
      }
    }
  });

  it.each([1011, 4408, 4409, 4430])('comes back by back-off after %i', (code) => {
    const rig = opened();
    rig.do(rig.session.closed(rig.now, code, ''));
    const waits: number[] = [];
    for (let failure = 0; failure < 4; failure++) {
      const [link] = rig.posts('link').filter(({ phase }) => phase === 'waiting');
      expect(link?.ending).toMatchObject({ code });
      waits.push((link?.retryAtMs ?? 0) - rig.now);
      rig.pass(waits.at(-1)! + 250);
      expect(rig.session.phase).toBe('connecting');
      rig.do(rig.session.closed(rig.now, code, ''));
    }
    expect(waits).toEqual([250, 500, 1000, 2000]);
  });
});

describe('words for endings', () => {
  const words = (code: number) => endingWords({ code, reason: '' });

  it('are of their own where the relay said why', () => {
    expect(words(1011)).toBe('The relay had an internal error.');
    expect(ko.endedFailed).toBe('릴레이에 내부 오류가 생겼습니다.');
    expect([words(1012), words(1013)]).toEqual([en.endedRestarting, en.endedFull]);
    expect([words(1006), words(4408)]).toEqual([en.endedLost, en.endedLost]);
  });

  it('name a reason whenever the page does not come back by itself', () => {
    const final = [...ENDINGS.keys()].filter((code) => retryOf(code) === 'never');
    expect(final.filter((code) => words(code) === en.endedLost)).toEqual([]);
  });
});
