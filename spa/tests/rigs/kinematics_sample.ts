import type { JointValues } from '../../src/twin/playback/pose.ts';
import { positionOf } from './joints.ts';

/** root_from_link computed row by row, with nothing but text matching and sums: an independent reference. */
export function forwardKinematics(text: string, values: JointValues): Map<string, number[]> {
  const joints = [...text.matchAll(/<joint name="([^"]+)" type="([^"]+)"[^>]*>([\s\S]*?)<\/joint>/g)].map(
    ([, name, type, inside]) => {
      const attribute = (tag: string, key: string) =>
        new RegExp(`<${tag}[^>]*\\b${key}="([^"]*)"`).exec(inside!)?.[1];
      const tuple = (tag: string, key: string) =>
        (attribute(tag, key) ?? '0 0 0').trim().split(/\s+/).map(Number);
      return {
        parent: attribute('parent', 'link')!,
        child: attribute('child', 'link')!,
        origin: compose(tuple('origin', 'xyz'), rpy(tuple('origin', 'rpy'))),
        turn:
          type === 'fixed'
            ? compose([0, 0, 0], rpy([0, 0, 0]))
            : compose([0, 0, 0], about(tuple('axis', 'xyz'), positionOf(values, name!) ?? 0)),
      };
    },
  );
  const children = new Set(joints.map((joint) => joint.child));
  const root = joints.find((joint) => !children.has(joint.parent))!.parent;
  const found = new Map([[root, compose([0, 0, 0], rpy([0, 0, 0]))]]);
  for (let pending = joints; pending.length > 0; ) {
    const next = pending.filter((joint) => !found.has(joint.parent));
    if (next.length === pending.length) throw new Error('not a tree');
    for (const joint of pending) {
      const parent = found.get(joint.parent);
      if (parent !== undefined) found.set(joint.child, times(times(parent, joint.origin), joint.turn));
    }
    pending = next;
  }
  return found;
}

function times(a: number[], b: number[]): number[] {
  return Array.from({ length: 16 }, (_, i) =>
    [0, 1, 2, 3].reduce((sum, k) => sum + a[Math.floor(i / 4) * 4 + k]! * b[k * 4 + (i % 4)]!, 0),
  );
}

function compose(xyz: number[], r: number[]): number[] {
  return [
    r[0],
    r[1],
    r[2],
    xyz[0],
    r[3],
    r[4],
    r[5],
    xyz[1],
    r[6],
    r[7],
    r[8],
    xyz[2],
    0,
    0,
    0,
    1,
  ] as number[];
}

/** Roll about x, then pitch about y, then yaw about z, all fixed axes (URDF). */
function rpy(angle: number[]): number[] {
  const [cr, cp, cy] = angle.map(Math.cos) as [number, number, number];
  const [sr, sp, sy] = angle.map(Math.sin) as [number, number, number];
  return [
    cy * cp,
    cy * sp * sr - sy * cr,
    cy * sp * cr + sy * sr,
    sy * cp,
    sy * sp * sr + cy * cr,
    sy * sp * cr - cy * sr,
    -sp,
    cp * sr,
    cp * cr,
  ];
}

/** Rodrigues' formula. */
function about(axis: number[], angle: number): number[] {
  const length = Math.hypot(...axis);
  const [x, y, z] = axis.map((part) => part / length) as [number, number, number];
  const c = Math.cos(angle);
  const s = Math.sin(angle);
  const t = 1 - c;
  return [
    t * x * x + c,
    t * x * y - s * z,
    t * x * z + s * y,
    t * x * y + s * z,
    t * y * y + c,
    t * y * z - s * x,
    t * x * z - s * y,
    t * y * z + s * x,
    t * z * z + c,
  ];
}
