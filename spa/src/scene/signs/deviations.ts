import type { PosedBody } from '../../model/posed_body.ts';
import { addScaled, directionThrough, originOf, rotateAbout, scale } from '../../model/vectors.ts';
import type { Deviation } from '../../twin/overlay/deviations.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { limbAcross } from './limb_across.ts';
import type { Paint } from './picture_numbers.ts';
import type { Strokes } from './strokes.ts';

/** Sizes in radii of the robot. */
const LEAST_RADIUS = 0.07;
const MOST_RADIUS = 0.2;
const THICK = 0.006;
const SPOKE = 0.004;
/** Smaller deviations (rad or m) get no arc. */
const LEAST = 1e-3;

export interface ShownDeviation {
  readonly channel: string;
  readonly error: number;
  readonly unit: string;
  readonly compliant: boolean;
  /** The anchor of its label (world, metres); null if none of its joints is in the model. */
  readonly at: Vec3 | null;
  /** The lines drawn for it (world, metres): from each joint to the middle of its arc, and along the limb. */
  readonly lines: readonly (readonly [Vec3, Vec3])[];
}

/** Draws arcs at joints that deviate from their command, from the limb's actual to its commanded position. */
export class DeviationOverlay {
  readonly shown: ShownDeviation[] = [];

  /** Adds its strokes. `from`: the displayed values, where arcs start; `reach`: the robot's radius, m. */
  draw(
    strokes: Strokes,
    body: PosedBody | null,
    deviations: readonly Deviation[],
    from: 'pos' | 'ref',
    reach: number,
    paint: (deviation: Deviation) => { line: Paint; fill: Paint },
  ): void {
    this.shown.length = 0;
    if (body === null) return;
    for (const deviation of deviations) {
      const { line, fill } = paint(deviation);
      let at: Vec3 | null = null;
      const lines: [Vec3, Vec3][] = [];
      for (const { joint, pos, ref } of deviation.joints) {
        const way = from === 'pos' ? ref - pos : pos - ref;
        const arc = drawArc(strokes, body, joint, way, reach, line, fill);
        if (arc === null) continue;
        at ??= arc.middle;
        lines.push(...arc.ends.map((end): [Vec3, Vec3] => [arc.joint, end]));
      }
      const { channel, error, unit: unitName, compliant } = deviation;
      this.shown.push({ channel, error, unit: unitName, compliant, at, lines });
    }
  }
}

/** A drawn arc, or the shaft for a prismatic joint: world, metres. */
interface DrawnArc {
  readonly joint: Vec3;
  readonly middle: Vec3;
  /** The ends of the lines that lead from the joint. */
  readonly ends: readonly Vec3[];
}

/** Draws one arc; null if the model has no such joint. */
function drawArc(
  strokes: Strokes,
  body: PosedBody,
  name: string,
  way: number,
  reach: number,
  line: Paint,
  fill: Paint,
): DrawnArc | null {
  const joint = body.joint(name);
  const worldFromLink = joint === undefined ? undefined : body.linkMatrix(joint.link)?.elements;
  if (joint === undefined || worldFromLink === undefined || !Number.isFinite(way)) return null;
  const at = originOf(worldFromLink);
  if (Math.abs(way) < LEAST) return { joint: at, middle: at, ends: [] };
  const axis = directionThrough(worldFromLink, joint.axis);
  if (joint.slides) {
    const along = scale(axis, Math.sign(way));
    strokes.shaft(at, along, Math.abs(way), THICK * reach, THICK * reach, line);
    const end = addScaled(at, along, Math.abs(way));
    return { joint: at, middle: end, ends: [end] };
  }
  const box = body.linkBox(joint.link);
  const limb = limbAcross(axis, box, worldFromLink);
  const size = box === undefined ? 0 : 0.7 * Math.hypot(...addScaled(box.max, box.min, -1));
  const radius = Math.min(MOST_RADIUS * reach, Math.max(LEAST_RADIUS * reach, size));
  strokes.arc(at, axis, limb, way, radius, THICK * reach, line);
  strokes.fan(at, axis, limb, way, 0, radius, fill);
  for (const spoke of [limb, rotateAbout(axis, way, limb)]) {
    strokes.shaft(at, spoke, radius, SPOKE * reach, SPOKE * reach, line);
  }
  const on = (turn: number) => addScaled(at, rotateAbout(axis, turn, limb), radius);
  return { joint: at, middle: on(way / 2), ends: [on(0), on(way / 2), on(way)] };
}
