// @vitest-environment happy-dom
import { afterEach, describe, expect, it, test } from 'vitest';
import {
  bindInsets,
  bindSelection,
  cameraKeys,
  channelOf,
  closeTo,
} from '../../src/app/robot/camera_controls.ts';
import type { KeyAction } from '../../src/app/shell/page_keys.ts';
import { selection, selectJoint } from '../../src/app/state/viewing.ts';
import type { Insets } from '../../src/scene/camera/insets.ts';
import { JointChannels, KinematicTree } from '../../src/twin/kinematic_tree.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { SCHEMA } from '../rigs/schema.ts';

/** In the schema LKN moves the joint `knee_left`. */
const TREE = new KinematicTree([
  { link: 'pelvis', parent: null, joint: null },
  { link: 'left', parent: 'pelvis', joint: 'knee_left' },
  { link: 'sole', parent: 'left', joint: null },
  { link: 'toe', parent: 'sole', joint: 'toe_left' },
  { link: 'right', parent: 'pelvis', joint: 'RKN' },
]);

function stage(tree: KinematicTree | null = TREE) {
  const twin = new RobotTwin('small', 0);
  twin.acceptSchema(SCHEMA);
  twin.acceptTree(tree);
  const element = document.createElement('div');
  const lit = new Map<string, number>();
  const told: string[] = [];
  let under: string | null = null;
  const view = {
    pick: () => under,
    visit: (link: string) => void told.push(link),
    goBack: () => void told.push('back'),
    setLinkLook: (link: string, { highlight = 0 }) => void lit.set(link, highlight),
  };
  const end = bindSelection(element, view, twin);
  const tap = (link: string | null) => {
    under = link;
    for (const type of ['pointerdown', 'pointerup'])
      element.dispatchEvent(new PointerEvent(type, { isPrimary: true, button: 0 }));
  };
  const bright = () => [...lit].filter(([, highlight]) => highlight > 0).map(([link]) => link);
  return { twin, told, end, tap, bright };
}

afterEach(() => selectJoint(null));

describe('a tapped link', () => {
  it('selects the channel that moves it, is lit, and the eye stays', () => {
    const { tap, bright, told } = stage();
    tap('sole');
    expect(selection()).toEqual({ joint: 'LKN', from: 'body' });
    expect(bright()).toEqual(['left', 'sole']);
    expect(told).toEqual([]);
  });

  it('that no channel moves stands for the nearest one that a channel does', () => {
    const channels = new JointChannels(SCHEMA);
    expect(channelOf('toe', TREE, channels)).toBe('LKN');
    expect(channelOf('pelvis', TREE, channels)).toBeNull();
    expect(channelOf('nobody', TREE, channels)).toBeNull();
    expect(channelOf('right', null, channels)).toBeNull();
  });

  it('is none where nothing is met', () => {
    const { tap } = stage();
    tap(null);
    tap('pelvis');
    expect(selection()).toBeNull();
  });
});

describe('a joint chosen among the numbers', () => {
  it('is brought before the eye and lit, again when it is chosen again; one at a time', () => {
    const { bright, told } = stage();
    selectJoint('RKN');
    selectJoint('RKN');
    expect([bright(), told]).toEqual([['right'], ['right', 'right']]);
    selectJoint('LKN');
    expect(bright()).toEqual(['left', 'sole']);
    selectJoint(null);
    expect([bright(), told.slice(2)]).toEqual([[], ['left', 'back']]);
  });

  it('is lit when the model comes after it, and dark when it goes or the page is left', () => {
    const { twin, bright, end } = stage(null);
    selectJoint('RKN');
    expect(bright()).toEqual([]);
    twin.acceptTree(TREE);
    expect(bright()).toEqual(['right']);
    twin.acceptTree(null);
    expect(bright()).toEqual([]);
    twin.acceptTree(TREE);
    end();
    expect(bright()).toEqual([]);
  });

  it('that the model does not have lights nothing', () => {
    const { bright, told } = stage();
    for (const odd of ['NK1', '__proto__', 'x'.repeat(10_000)]) selectJoint(odd);
    expect([bright(), told]).toEqual([[], []]);
  });
});

/** A view that records its calls. */
function eye(link: string | null = 'head') {
  const told: string[] = [];
  const tell =
    (word: string) =>
    (...how: (string | number)[]) =>
      void told.push([word, ...how.map((x) => (typeof x === 'number' ? x.toFixed(2) : x))].join(' '));
  const view = {
    look: tell('look'),
    focus: tell('focus'),
    orbit: tell('orbit'),
    pan: tell('pan'),
    zoom: tell('zoom'),
    pick: (x: number, y: number) => (x === 5 && y === 6 ? link : null),
  };
  return { view, told };
}

test.each([
  ['turn', 'ArrowLeft', 'orbit 0.13 0.00'],
  ['turn', 'ArrowUp', 'orbit 0.00 0.13'],
  ['pan', 'ArrowDown', 'pan 0.00 -40.00'],
  ['nearer', '+', 'zoom 0.85'],
  ['farther', '-', 'zoom 1.18'],
  ['home', '0', 'look home'],
  ['top', '3', 'look top'],
  ['closeUp', 'c', 'focus head'],
] as const satisfies readonly (readonly [KeyAction, string, string])[])(
  '%s by %s is %s',
  (action, key, does) => {
    const { view, told } = eye();
    const keys = cameraKeys(view, () => ({ x: 5, y: 6 }));
    keys[action]?.(new KeyboardEvent('keydown', { key }));
    expect(told).toEqual([does]);
  },
);

test('where no link is, the first view comes back', () => {
  const { view, told } = eye(null);
  closeTo(view, { x: 5, y: 6 });
  expect(told).toEqual(['look home']);
});

/** A stage of 300 px; the elements over it by class, with their range below its top edge. */
function coveredStage(parts: Readonly<Record<string, readonly [number, number]>>): HTMLElement {
  document.body.innerHTML = '<section><div class="canvas"></div></section>';
  const section = document.querySelector('section')!;
  const put = (element: Element, top: number, bottom: number) => {
    element.getBoundingClientRect = () => new DOMRect(0, 50 + top, 400, bottom - top);
  };
  put(section, 0, 300);
  for (const [name, [top, bottom]] of Object.entries(parts)) {
    const part = document.createElement('div');
    part.className = name;
    put(part, top, bottom);
    section.append(part);
  }
  return section.querySelector<HTMLElement>('.canvas')!;
}

function coverOf(canvas: HTMLElement): Insets | null {
  let told: Insets | null = null;
  bindInsets(canvas, {
    setCover: (cover) => {
      told = cover;
    },
  })();
  return told;
}

afterEach(() => {
  document.body.innerHTML = '';
});

it('tells how far notes reach down and buttons up', () => {
  const covered = coverOf(
    coveredStage({ 'stage-note': [14, 50], 'stage-views': [54, 90], 'stage-tools': [250, 290] }),
  );
  expect(covered).toEqual({ above: 94, below: 50 });
});

it('what is hidden or empty covers nothing', () => {
  const covered = coverOf(coveredStage({ 'stage-views': [10, 10], 'stage-tools': [-50, -50] }));
  expect(covered).toEqual({ above: 0, below: 0 });
});
