import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { connectParent } from '../../src/app/pages/embed/parent.ts';
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
