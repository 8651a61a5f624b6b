import { parseSchema } from '@posecast/wire';
import { OVERLAY_COLORS } from '../../src/scene/signs/colors.ts';
import type { Sign, SignFrame, SignKind, SignPicture, SignSettings } from '../../src/scene/signs/sign.ts';
import { Facets, Strokes } from '../../src/scene/signs/strokes.ts';
import { ValueLimits } from '../../src/twin/limits.ts';
import { sampleLeg } from './leg_sample.ts';
import { codesOf } from './schema.ts';

/** The parts of a robot's schema that differ between tests. */
interface Parts {
  readonly ftf?: readonly string[];
  readonly quat?: readonly string[];
  readonly base?: boolean;
  readonly mapping?: object;
}

const of = (site: string, parts: readonly string[]) => parts.map((part) => `${site}.${part}`);
const XYZ = ['x', 'y', 'z'];
const WXYZ = ['w', ...XYZ];

/** The schema of `sampleLeg`: its knee, a force-torque sensor at its foot with limits of 500 N and 10 N·m, and IMUs at these links. */
export function legSchema({ ftf = ['fx', 'fy', 'fz'], quat = [], base = false, mapping = {} }: Parts = {}) {
  const joint = { labels: 'joint', scale: 0.001 };
  const imus = quat.map((link) => [link, { kind: 'imu', name: link, link }] as const);
  const limits = (labels: readonly string[], high: number) =>
    Object.fromEntries(labels.map((label) => [label, { low: -high, high, caution: 0.5 }]));
  const [forces, moments] = [of('F', ftf), of('F', ['mx', 'my', 'mz'])];
  return parseSchema(
    JSON.stringify({
      ...{ type: 'schema', v: 1, robot: 'Leg' },
      labels: {
        joint: ['knee'],
        ...(ftf.length > 0 ? { ftf: forces, ftm: moments } : {}),
        ...(quat.length > 0 ? { quat: quat.flatMap((link) => of(link, WXYZ)) } : {}),
        ...(base ? { base: of('base', XYZ), baseq: of('base', WXYZ) } : {}),
      },
      fields: [
        { name: 'ref', unit: 'rad', ...joint },
        { name: 'pos', unit: 'rad', ...joint },
        { name: 'temp', unit: 'C', labels: 'joint', scale: 1 },
        { name: 'flags', bits: ['comply'], labels: 'joint' },
        ...(ftf.length > 0
          ? [
              { name: 'ftf', unit: 'N', scale: 1, labels: 'ftf' },
              { name: 'ftm', unit: 'Nm', scale: 0.01, labels: 'ftm' },
            ]
          : []),
        ...(quat.length > 0 ? [{ name: 'quat', scale: 1e-6, labels: 'quat' }] : []),
        ...(base ? ['base', 'baseq'].map((name) => ({ name, scale: 1e-6, labels: name })) : []),
      ],
      mapping: {
        sensors: {
          ...(ftf.length > 0 ? { F: { kind: 'wrench', name: 'foot', link: 'foot' } } : {}),
          ...Object.fromEntries(imus),
        },
        thresholds: {
          ftf: limits(forces, 500),
          ftm: limits(moments, 10),
          temp: { '*': { high: 70, caution: 0.8 } },
        },
        tolerance: { '*': 0.05 },
        ...mapping,
      },
    }),
  );
}

export const SETTINGS: SignSettings = {
  ...{ shown: 'pos', lens: true, forces: true, level: true, load: 'off', balance: 'off', signs: {} },
  ...{ arrowScale: 1, headingLocked: false, palette: 'standard', angle: 'rad' },
};

type Given = Omit<Partial<SignFrame>, 'codes' | 'settings'> & { readonly settings?: Partial<SignSettings> };

/** A live frame with these codes, as an array or by channel: `{ 'ftf.F.fz': 300 }`. */
export function signFrame(
  given: Int32Array | Parameters<typeof codesOf>[1] = {},
  { schema = legSchema(), settings, ...others }: Given = {},
): SignFrame {
  return {
    ...{
      schema,
      codes: given instanceof Int32Array ? given : codesOf(schema, given),
      limits: new ValueLimits(schema.mapping),
      tS: 1,
      lead: null,
    },
    ...{ joint: null, live: true, language: 'en', nameOf: (channel: string) => channel },
    settings: { ...SETTINGS, ...settings },
    ...others,
  };
}

/** A picture of a leg with a radius of 0.5 m. */
export function signPicture(frame = signFrame(), given: Partial<SignPicture> = {}): SignPicture {
  return {
    ...{ frame, body: sampleLeg(), pose: null, reach: 0.5, colors: OVERLAY_COLORS.dark, tints: new Map() },
    ...{ strokes: new Strokes(), facets: new Facets(), feet: [], supportM: null, middle: [0, 0, 0] },
    ...given,
  };
}

/** A sign that has read a frame and is drawn, its arrows at their full length. */
export function drawnSign<S extends Sign>(
  kind: SignKind<S>,
  frame: SignFrame,
  given: Partial<SignPicture> = {},
): { sign: S; picture: SignPicture; strokes: number } {
  const sign = new kind(frame.schema);
  sign.read(frame);
  while (sign.advance?.(1));
  const picture = signPicture(frame, given);
  picture.strokes.begin();
  sign.draw(picture);
  picture.strokes.end();
  return { sign, picture, strokes: picture.strokes.count };
}
