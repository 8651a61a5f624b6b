// @vitest-environment happy-dom
import type { Schema } from '@posecast/wire';
import { createElement } from 'react';
import { createRoot } from 'react-dom/client';
import { type InstancedBufferGeometry, type Mesh, PerspectiveCamera } from 'three';
import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { keysOfLabel } from '../../src/app/explain/catalogue.ts';
import { SignMenu } from '../../src/app/robot/SignMenu.tsx';
import type { RobotLink } from '../../src/app/state/robot_link.ts';
import { changeSettings, settings } from '../../src/app/state/settings.ts';
import { OVERLAY_COLORS } from '../../src/scene/signs/colors.ts';
import { Overlay } from '../../src/scene/signs/overlay.ts';
import {
  levelPaint,
  type Sign,
  type SignFrame,
  type SignKind,
  type SignPicture,
} from '../../src/scene/signs/sign.ts';
import { RobotSigns, SIGNS } from '../../src/scene/signs/signs.ts';
import { OverlayPart } from '../../src/scene/three/overlay_part.ts';
import type { RobotNode } from '../../src/scene/three/robot_node.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import type { Vec3 } from '../../src/twin/rotation.ts';
import { valueAt } from '../../src/twin/values.ts';
import { sampleLeg } from '../rigs/leg_sample.ts';
import { paintedStrokes } from '../rigs/painted_strokes.ts';
import { legSchema, signFrame } from '../rigs/signs.ts';

/** A sign like any other, for the guide to extending the page: a bar over the robot, as long as its knee is bent. */
class Bend implements Sign {
  static readonly key = 'bend';
  static readonly menu: NonNullable<SignKind['menu']> = { name: { en: 'Bent knee', ko: '굽힌 무릎' } };
  drawn: number | null = null;
  readonly #schema: Schema;

  constructor(schema: Schema) {
    this.#schema = schema;
  }

  static can(schema: Schema): boolean {
    return schema.field('pos')?.labels.includes('knee') ?? false;
  }

  read({ codes }: SignFrame): void {
    this.drawn = valueAt(codes, this.#schema.field('pos'), 0);
  }

  draw(picture: SignPicture): void {
    picture.strokes.shaft(TOP, UP, this.drawn ?? 0, 0.01, 0.01, levelPaint(picture, 'ok'));
  }

  labels({ frame: { nameOf } }: SignPicture) {
    const text = `${nameOf('knee')} ${this.drawn} rad`;
    return [{ key: 'bend', text, level: 'ok', at: TOP, lines: [], explain: ['signs.ghost'] } as const];
  }
}

/** The same for few: off until a viewer wants it. */
class RareBend extends Bend {
  static override readonly menu = { ...Bend.menu, on: false };
}

const [TOP, UP]: [Vec3, Vec3] = [
  [0, 0, 1],
  [0, 0, 1],
];
const SCHEMA = legSchema({ ftf: [] });

/** Its signs, once they have read a frame with the page's settings. */
function signs(): RobotSigns {
  const read = new RobotSigns();
  read.read(signFrame({ 'pos.knee': 400, 'ref.knee': 400 }, { schema: SCHEMA, settings: settings() }));
  return read;
}

beforeEach(() => void (SIGNS as SignKind[]).push(Bend)); // the line in the list
afterEach(() => {
  (SIGNS as SignKind[]).pop();
  document.body.replaceChildren();
});

it('is drawn in the 3D view and the light view, with its label', () => {
  const bearer = { figure: sampleLeg(), pose: null };

  const host = document.body.appendChild(document.createElement('div'));
  const camera = new PerspectiveCamera();
  camera.position.set(0, 0, 4);
  const room = () => ({ width: 400, height: 300, top: 0, free: 300 });
  const part = new OverlayPart({ host, camera, room, changed: () => {}, wake: () => {} });
  part.show(bearer as unknown as RobotNode, signs());
  part.advance(1);
  const [pass] = part.object.children[0]!.children as Mesh<InstancedBufferGeometry>[];
  expect(pass!.geometry.instanceCount).toBe(1);
  const label = host.querySelector<HTMLElement>('[data-sign=bend]')!;
  expect([label.textContent, label.hidden, label.dataset.level]).toEqual(['knee 0.4 rad', false, 'ok']);
  expect(keysOfLabel(label)).toEqual(['signs.ghost']);

  const light = new Overlay(document.createElement('div'), OVERLAY_COLORS.dark, false);
  light.show(bearer, signs());
  light.make();
  const painted = paintedStrokes(light.strokes);
  expect(painted.map(({ color }) => color)).toContain('rgb(47 191 113 / 1)');
  expect(light.drawn(bearer).bend).toBeCloseTo(0.4);
});

it.each([
  [true, Bend],
  [false, RareBend],
])('has a switch in the menu, at first %s, which the browser keeps', async (first, kind) => {
  (SIGNS as SignKind[])[SIGNS.length - 1] = kind;
  changeSettings({ signs: {} });
  const twin = new RobotTwin('leg', 0);
  twin.acceptSchema(SCHEMA);
  const host = document.body.appendChild(document.createElement('div'));
  const root = createRoot(host);
  root.render(createElement(SignMenu, { links: [{ twin } as unknown as RobotLink], drawsBalance: true }));
  await vi.waitFor(() => host.querySelector<HTMLElement>('button')!.click());
  const box = await vi.waitFor(() => {
    const labels = [...host.querySelectorAll<HTMLElement>('.switch')];
    const found = labels.find(({ textContent }) => textContent === 'Bent knee')?.querySelector('input');
    expect(found?.checked).toBe(first);
    return found!;
  });
  expect(signs().of(kind) !== null).toBe(first);
  box.click();
  expect(settings().signs).toEqual({ bend: !first });
  expect(signs().of(kind) !== null).toBe(!first);
  expect(JSON.parse(localStorage.getItem('posecast.settings')!).signs).toEqual({ bend: !first });
  box.click();
  expect(signs().of(kind)?.drawn ?? null).toEqual(first ? expect.closeTo(0.4) : null);
  root.unmount();
});
