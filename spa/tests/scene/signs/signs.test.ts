// @vitest-environment happy-dom
import { describe, expect, it, vi } from 'vitest';
import { Attitude } from '../../../src/scene/signs/attitude.ts';
import { Balance, FILES } from '../../../src/scene/signs/balance.ts';
import { OVERLAY_COLORS } from '../../../src/scene/signs/colors.ts';
import { Deviations } from '../../../src/scene/signs/deviations.ts';
import { Forces } from '../../../src/scene/signs/forces.ts';
import { Load } from '../../../src/scene/signs/load.ts';
import { Overlay } from '../../../src/scene/signs/overlay.ts';
import type { SignKind } from '../../../src/scene/signs/sign.ts';
import { RobotSigns, SIGNS } from '../../../src/scene/signs/signs.ts';
import { sampleLeg } from '../../rigs/leg_sample.ts';
import { codesWith, SCHEMA } from '../../rigs/schema.ts';
import { legSchema, signFrame } from '../../rigs/signs.ts';

const KINDS: readonly SignKind[] = [Forces, Attitude, Deviations, Balance, Load];
const OFF = { lens: false, forces: false, level: false } as const;

describe('the signs of a robot', () => {
  it('are read only as far as they are wanted', () => {
    const signs = new RobotSigns(KINDS);
    const read = (settings: Parameters<typeof signFrame>[1] = {}) =>
      signs.read(signFrame(codesWith({ 'ref.RKN': 500 }), { schema: SCHEMA, ...settings }));
    const on = () => KINDS.filter((kind) => signs.of(kind) !== null);
    read({ settings: { load: 'temp' } });
    expect(on()).toEqual([Forces, Attitude, Deviations, Load]);
    expect(signs.ghost?.limbs).toEqual(['RKN']);
    read({ settings: OFF });
    expect(on()).toEqual([]);
    expect(signs.ghost).toBeNull();
    expect(signs.drawn).toMatchObject({
      wrenches: [],
      deviations: [],
      level: { roll: null },
      loads: {},
      balance: null,
    });
    read({ settings: { ...OFF, shown: 'both' } });
    expect(on(), 'arcs lead to the other pose').toEqual([Deviations]);
    signs.read(null);
    expect([on(), signs.drawn]).toEqual([[], {}]);
  });

  it('are offered if a robot can have them: none to one that only says where its joints are', () => {
    const offered = (schema: typeof SCHEMA) => SIGNS.filter((kind) => kind.can(schema));
    expect(offered(SCHEMA)).toEqual(expect.arrayContaining([...KINDS]));
    expect(Load.fieldsOf(SCHEMA)).toEqual(['cur', 'temp']);
    expect(offered(FILES), 'its masses may be known').toEqual([Balance]);
  });
});

describe('balance', () => {
  const schema = legSchema({ base: true, mapping: { balance: { feet: ['F'], ground: 'measured' } } });
  const force = { vector: [0, 0, 392] as const, axes: [0, 1, 2] };
  const pose = {
    joints: { names: [], values: [] },
    base: null,
    tS: 1,
    wrenches: [{ site: 'F', force, moment: force }],
  };
  const inertial = { link: 1, mass_kg: 40, xyz: [0, 0, -0.1], inertia: [1, 0, 0, 1, 0, 1] };
  const points = [
    [-0.1, -0.05, -0.05],
    [0.15, -0.05, -0.05],
    [0.15, 0.05, -0.05],
  ];
  const robot = (facets: boolean) => {
    const figure = sampleLeg();
    Object.assign(figure.manifest, { raw: { inertials: [inertial], soles: [{ link: 3, points }] } });
    const [overlay, signs] = [
      new Overlay(document.createElement('div'), OVERLAY_COLORS.dark, facets),
      new RobotSigns(KINDS),
    ];
    const bearer = { figure, pose };
    return (choice: 'auto' | 'on' | 'off') => {
      signs.read(
        signFrame({ 'baseq.base.w': 1e6, 'ftf.F.fz': 2 }, { schema, settings: { balance: choice } }),
      );
      overlay.show(bearer, signs);
      while (overlay.advance(1));
      overlay.make();
      return [overlay.strokes.count, overlay.facets?.count ?? 0];
    };
  };

  it('loads its code for who wants it, where facets are drawn', () => {
    robot(false)('on');
    robot(true)('auto'); // no biped
    expect(Balance.part.value()).toBeNull();
  });

  it('stands alone under the robot, without the plane of what is level and the ring at a foot', async () => {
    const show = robot(true);
    show('on');
    await vi.waitFor(() => expect(Balance.part.value()).not.toBeNull());
    const [alone, nothing] = show('off');
    const [beside, facets] = show('on');
    expect(alone! - beside!).toBe(7); // fan, rim and four ticks; the ring
    expect([nothing, facets! > 500]).toEqual([0, true]);
  });
});
