import { markOnce } from '../../browser/painting.ts';
import { boundsOf, extentOf, type LinkBox, lowestOf } from '../../model/bounds.ts';
import { Kinematics, placeLinks, transform } from '../../model/kinematics.ts';
import { boxesOfLinks, type Manifest } from '../../model/manifest.ts';
import type { Pose } from '../../twin/playback/pose.ts';
import { directionOf, FIELD_OF_VIEW, fittingDistance } from '../camera/framing.ts';

const LINE_CSS_PIXELS = 2;
const DOT_CSS_PIXELS = 2.5;
const MAX_PIXEL_RATIO = 2;

type Vector = readonly [number, number, number];

/**
 * The robot as lines from link to link on a 2D canvas. It moves while the code of the 3D scene (a quarter of a megabyte) is still
 * loading. It is seen from the scene's initial camera position, so that nothing jumps when the scene takes over.
 */
export class StickFigure {
  readonly #canvas: HTMLCanvasElement;
  readonly #kinematics: Kinematics;
  readonly #parents: readonly number[];
  readonly #boxes: ReadonlyMap<number, LinkBox>;
  readonly #worldFromLink: Float64Array;
  readonly #points: Float64Array;
  #eye: Eye | null = null;
  #base: Pose['base'] = null;
  #posed = false;
  #color = '';
  #asked = false;

  constructor(canvas: HTMLCanvasElement, manifest: Manifest) {
    this.#canvas = canvas;
    this.#kinematics = new Kinematics(manifest.joints);
    this.#parents = manifest.joints.map(({ parent }) => parent);
    this.#boxes = boxesOfLinks(manifest);
    this.#worldFromLink = new Float64Array(manifest.links.length * 16);
    this.#points = new Float64Array(manifest.links.length * 2);
  }

  setPose({ joints, base }: Pose): void {
    this.#kinematics.set(joints);
    this.#base = base;
    this.#posed = true;
    this.#ask();
  }

  /** A CSS colour for its lines. */
  setColor(color: string): void {
    this.#color = color;
    this.#ask();
  }

  #ask(): void {
    if (this.#asked) return;
    this.#asked = true;
    requestAnimationFrame(() => {
      this.#asked = false;
      this.#draw();
    });
  }

  #draw(): void {
    const { clientWidth: width, clientHeight: height } = this.#canvas;
    const context = this.#canvas.getContext('2d');
    if (context === null || width === 0 || height === 0 || !this.#posed) return;
    const ratio = Math.min(window.devicePixelRatio, MAX_PIXEL_RATIO);
    this.#canvas.width = width * ratio; // which clears it
    this.#canvas.height = height * ratio;
    context.scale(ratio, ratio);
    this.#spread();
    this.#eye ??= this.#frame(width / height, height);
    this.#project(this.#eye, width, height);
    context.strokeStyle = context.fillStyle = this.#color;
    context.lineWidth = LINE_CSS_PIXELS;
    context.lineCap = 'round';
    const at = this.#points;
    context.beginPath();
    for (const [joint, parent] of this.#parents.entries()) {
      const child = joint + 1;
      context.moveTo(at[parent * 2]!, at[parent * 2 + 1]!);
      context.lineTo(at[child * 2]!, at[child * 2 + 1]!);
    }
    context.stroke();
    context.beginPath();
    for (let i = 0; i < at.length; i += 2) {
      context.moveTo(at[i]!, at[i + 1]!);
      context.arc(at[i]!, at[i + 1]!, DOT_CSS_PIXELS, 0, 2 * Math.PI);
    }
    context.fill();
    markOnce('posecast:skeleton');
  }

  /** Computes the poses of all links in the world. */
  #spread(): void {
    this.#kinematics.compute();
    const { rootFromLink } = this.#kinematics;
    const { xyz, quat_wxyz } = this.#base ?? {
      xyz: [0, 0, -lowestOf(rootFromLink, this.#boxes)] as Vector,
      quat_wxyz: [1, 0, 0, 0] as const,
    };
    placeLinks(transform(xyz, quat_wxyz), rootFromLink, this.#worldFromLink);
  }

  #frame(aspect: number, heightPx: number): Eye {
    const { min, max } = boundsOf(this.#worldFromLink, this.#boxes);
    return homeEye(min, max, aspect, heightPx);
  }

  #project({ target, ahead, right, up, distance }: Eye, width: number, height: number): void {
    const scale = height / 2 / Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
    for (let link = 0; link * 16 < this.#worldFromLink.length; link += 1) {
      const at = link * 16 + 12;
      const offset: Vector = [
        this.#worldFromLink[at]! - target[0],
        this.#worldFromLink[at + 1]! - target[1],
        this.#worldFromLink[at + 2]! - target[2],
      ];
      const depth = Math.max(1e-3, dot(offset, ahead) + distance);
      this.#points[link * 2] = width / 2 + (dot(offset, right) / depth) * scale;
      this.#points[link * 2 + 1] = height / 2 - (dot(offset, up) / depth) * scale;
    }
  }
}

/** A camera `distance` metres from its target; its directions are unit vectors in the world. */
export interface Eye {
  readonly target: Vector;
  readonly ahead: Vector;
  readonly right: Vector;
  readonly up: Vector;
  readonly distance: number;
}

/** The home view of a robot that fills this box, in a picture of this aspect (width : height) and height, CSS px. */
export function homeEye(min: Vector, max: Vector, aspect: number, heightPx?: number): Eye {
  const extent = extentOf(min, max);
  const { azimuth, elevation } = directionOf('home', extent);
  const [a, e] = [(azimuth * Math.PI) / 180, (elevation * Math.PI) / 180];
  return {
    target: [(min[0] + max[0]) / 2, (min[1] + max[1]) / 2, (min[2] + max[2]) / 2],
    ahead: [-Math.cos(e) * Math.cos(a), -Math.cos(e) * Math.sin(a), -Math.sin(e)],
    right: [-Math.sin(a), Math.cos(a), 0],
    up: [-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e)],
    distance: fittingDistance(extent, aspect, heightPx),
  };
}

function dot(a: Vector, b: Vector): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
