// @vitest-environment happy-dom
import { afterEach, describe, expect, it } from 'vitest';
import { bindSelection, channelOf } from '../../src/app/robot/camera_controls.ts';
import { selection, selectJoint } from '../../src/app/state/viewing.ts';
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
