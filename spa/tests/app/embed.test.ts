import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { framedRobot } from '../../src/app/pages/embed/EmbedPage.tsx';
import { connectParent, parentOrigin, readParentRequest } from '../../src/app/pages/embed/parent.ts';
import { shownScene } from '../../src/app/shell/debug_api.ts';
import type { RobotLink } from '../../src/app/state/robot_link.ts';
import { settings } from '../../src/app/state/settings.ts';
import { pastControls, selection, selectJoint } from '../../src/app/state/viewing.ts';
import type { PastControls } from '../../src/past/past_types.ts';
import type { BodyView } from '../../src/scene/figure/body_view.ts';

const COURSE = 'https://course.example';
const LIVE = { robot: 'demo', word: 'LIVE', cause: null, age_ms: 12, moment_ms: null };
const parent = { postMessage: vi.fn() };
let hear: (event: object) => void = () => {};
let tellWord: () => void = () => {};
let tellLink: () => void = () => {};
const link = {
  twin: { robot: 'demo' },
  client: {
    link: { behindMs: null as number | null },
    onChange: (listener: () => void) => {
      tellLink = listener;
      return () => {
        tellLink = () => {};
      };
    },
  },
  watch: {
    verdict: () => ({ word: 'LIVE', cause: null, ageMs: 12 }),
    onWord: (listener: () => void) => {
      tellWord = listener;
      return () => {
        tellWord = () => {};
      };
    },
  },
} as unknown as RobotLink;

beforeEach(() => {
  parent.postMessage.mockClear();
  vi.stubGlobal('window', {
    parent,
    location: { search: `?origin=${COURSE}` },
    localStorage: { getItem: () => null },
    addEventListener: (_: string, listener: typeof hear) => {
      hear = listener;
    },
    removeEventListener: () => {
      hear = () => {};
    },
  });
});
afterEach(() => vi.unstubAllGlobals());

it('tells the page around it, and no other, how the robot is', () => {
  const end = connectParent(link);
  tellWord();
  expect(parent.postMessage.mock.calls).toEqual([
    [{ posecast: 'ready', ...LIVE, behind_ms: null }, COURSE],
    [{ posecast: 'liveness', ...LIVE, behind_ms: null }, COURSE],
  ]);
  end();
  tellWord();
  expect(parent.postMessage).toHaveBeenCalledTimes(2);
});

it('tells how far behind it is, when that changes', () => {
  const end = connectParent(link);
  parent.postMessage.mockClear();
  tellLink();
  expect(parent.postMessage).not.toHaveBeenCalled();
  Object.assign(link.client.link, { behindMs: 4300 });
  tellLink();
  tellLink();
  expect(parent.postMessage.mock.calls).toEqual([
    [{ posecast: 'liveness', ...LIVE, behind_ms: 4300 }, COURSE],
  ]);
  end();
  Object.assign(link.client.link, { behindMs: null });
  tellLink();
  expect(parent.postMessage).toHaveBeenCalledTimes(1);
});

it('hears the page around it, and no other', () => {
  const look = vi.fn();
  shownScene.set({ look } as unknown as BodyView);
  const end = connectParent(link);
  const wish = { posecast: 'look', view: 'side' };
  hear({ source: parent, origin: 'https://evil.example', data: wish });
  hear({ source: {}, origin: COURSE, data: wish });
  expect(look).not.toHaveBeenCalled();
  hear({ source: parent, origin: COURSE, data: wish });
  expect(look).toHaveBeenCalledWith('side');
  hear({ source: parent, origin: COURSE, data: { posecast: 'set', angle: 'deg' } });
  expect(settings().angle).toBe('deg');
  selectJoint(null);
  hear({ source: parent, origin: COURSE, data: { posecast: 'select', joint: 'RKN' } });
  expect(selection()?.joint).toBe('RKN');
  end();
  shownScene.set(null);
});

it('plays a recording, and nothing that is live or plays already', () => {
  const toggle = vi.fn();
  const end = connectParent(link);
  const ask = (playhead: object | null) => {
    pastControls.set(playhead as PastControls | null);
    hear({ source: parent, origin: COURSE, data: { posecast: 'play' } });
  };
  ask(null);
  ask({ playhead: { at: 'live', playing: false }, toggle });
  ask({ playhead: { at: 'past', playing: true }, toggle });
  expect(toggle).not.toHaveBeenCalled();
  ask({ playhead: { at: 'past', playing: false }, toggle });
  expect(toggle).toHaveBeenCalledTimes(1);
  pastControls.set(null);
  end();
});

it('says nothing where the address names nobody', () => {
  (window as unknown as { location: { search: string } }).location.search = '';
  connectParent(link);
  expect(parent.postMessage).not.toHaveBeenCalled();
});

describe('the page around a frame', () => {
  it('may ask for what the frame knows', () => {
    expect(readParentRequest({ posecast: 'look', view: 'side' })).toEqual({ posecast: 'look', view: 'side' });
    expect(readParentRequest({ posecast: 'select', joint: 'RKN' })).toEqual({
      posecast: 'select',
      joint: 'RKN',
    });
    expect(readParentRequest({ posecast: 'select', joint: null })).toEqual({
      posecast: 'select',
      joint: null,
    });
    expect(readParentRequest({ posecast: 'play', speed: 8 })).toEqual({ posecast: 'play' });
    expect(readParentRequest({ posecast: 'set', angle: 'deg', theme: 'pink', palette: 'safe' })).toEqual({
      posecast: 'set',
      changed: { angle: 'deg' },
    });
  });

  it('may say anything', () => {
    const odd = [null, 'look', 7, [], {}, { posecast: 'look' }, { posecast: 'look', view: '__proto__' }];
    for (const data of [
      ...odd,
      { posecast: 'select', joint: 7 },
      { posecast: 'set', theme: {} },
      { posecast: 'x' },
    ]) {
      expect(readParentRequest(data)).toBeNull();
    }
  });

  it('is the one that the address names, and nobody else', () => {
    expect(parentOrigin('?origin=https://course.example/week-3?x')).toBe('https://course.example');
    for (const none of [
      '',
      '?origin=',
      '?origin=*',
      '?origin=null',
      '?origin=javascript:alert(1)',
      '?origin=data:,x',
    ]) {
      expect(parentOrigin(none), none).toBeNull();
    }
  });
});

it.each([
  ['/embed/hubo', '', 'hubo'],
  ['/lab/embed/hubo', '#/r/hubo?theme=light', 'hubo'],
  ['/embed/', '#/r/hubo', 'hubo'],
  ['/embed/index.html', '#/r/hubo', 'hubo'],
  ['/embed/', '', null],
  // the page's headers are for the robot that the path names
  ['/embed/open', '#/r/hubo', null],
  ['/embed/%6fpen', '#/r/hubo', null],
  ['/embed/%6fpen', '', null],
  ['/embed//open', '#/r/hubo', null],
])('%s%s shows %s', (pathname, hash, robot) => {
  expect(framedRobot(pathname, hash)).toBe(robot);
});
