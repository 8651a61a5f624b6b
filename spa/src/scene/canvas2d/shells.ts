import { multiply } from '../../model/kinematics.ts';
import type { Lod } from '../../model/lod.ts';
import type { Visual } from '../../model/manifest.ts';
import type { LinkLook, LinkTint } from '../../model/posed_body.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import type { LightColors } from './colors.ts';
import { FILL, KEY, SHADES_PER_LIGHT, Tables } from './lighting.ts';
import { type Corners, type Rasterizer, SHADES } from './rasterizer.ts';

/** The range of one visual's vertices; a level stores them visual by visual. */
interface Run {
  readonly first: number;
  readonly end: number;
}

/** How one link is drawn. */
export interface LinkPaint {
  readonly look: LinkLook;
  /** null: its own colours. */
  readonly tint: LinkTint | null;
}

/** The camera and the pose that meshes are drawn with. */
export interface ShellView {
  /** As in `CameraRig.screenFromWorld`, in pixels of the raster. */
  readonly screenFromWorld: Float64Array;
  /** The camera's position in the world, metres. */
  readonly eye: Readonly<Vec3>;
  /** 16 numbers a link, column-major. */
  readonly worldFromLink: Float64Array;
  /** Near clipping distance, metres. */
  readonly near: number;
}

/** Draws the meshes of a level into a `Rasterizer`: matt in their colours, or as glass. */
export class Shells {
  readonly #level: Lod;
  readonly #visuals: readonly Visual[];
  readonly #runs: readonly Run[];
  readonly #corners: Corners;
  readonly #tables: Tables;
  #tones: LightColors;

  /** `pictures`: the mean colour (linear) of each of the level's textures; null for one that can't be read. */
  constructor(
    level: Lod,
    pictures: readonly (readonly [number, number, number] | null)[],
    visuals: readonly Visual[],
    tones: LightColors,
  ) {
    const vertices = level.parts.length / 2;
    const ends = new Int32Array(level.ranges.length).fill(0);
    const firsts = new Int32Array(level.ranges.length).fill(vertices);
    for (let i = 0; i < vertices; i += 1) {
      const bone = level.parts[i * 2]!;
      if (i < firsts[bone]!) firsts[bone] = i;
      ends[bone] = i + 1;
    }
    this.#level = level;
    this.#visuals = visuals;
    this.#runs = level.ranges.map((_, i) => ({ first: firsts[i]!, end: ends[i]! }));
    this.#corners = {
      x: new Float32Array(vertices),
      y: new Float32Array(vertices),
      inverseW: new Float32Array(vertices),
      shade: new Float32Array(vertices),
    };
    this.#tones = tones;
    this.#tables = new Tables(meanPaints(level, pictures), tones);
  }

  setTones(tones: LightColors): void {
    this.#tones = tones;
    this.#tables.setTones(tones);
  }

  /** Draws all visible links; returns how many triangles were on the screen. */
  draw(raster: Rasterizer, shot: ShellView, paintOf: (link: number) => LinkPaint): number {
    const level = this.#level;
    const tables = this.#tables;
    let drawn = 0;
    for (const visual of this.#nearestFirst(shot)) {
      const { look, tint } = paintOf(this.#visuals[visual]!.link);
      const fade = look.fade ?? 0;
      if (look.hide === true || fade >= 1) continue;
      this.#project(visual, shot);
      this.#light(visual);
      const first = tint === null ? tables.firstRow(look) : tables.tintRow(tint, look);
      const rowOf =
        tint === null ? (corner: number) => first + 2 * level.parts[corner * 2 + 1]! : () => first;
      const ranges = level.ranges[visual]!;
      for (let r = 0; r < ranges.length; r += 2) {
        const paint = level.parts[level.index[ranges[r]!]! * 2 + 1]!;
        const opacity = Math.min(1, level.paints[paint * 4 + 3]!);
        const hatched = tint === null ? tables.isStandIn(paint) : tint.hatched;
        const seen = opacity * (1 - fade);
        const { colors } = tables;
        const [start, count] = [ranges[r]!, ranges[r + 1]!];
        drawn += raster.draw(this.#corners, level.index, start, count, colors, rowOf, seen, hatched);
      }
    }
    return drawn;
  }

  /** Draws only these links, as glass; returns how many triangles were on the screen. */
  drawGlass(raster: Rasterizer, shot: ShellView, links: ReadonlySet<number>): number {
    const level = this.#level;
    const row = this.#tables.glassRow();
    let drawn = 0;
    for (const visual of this.#nearestFirst(shot)) {
      if (!links.has(this.#visuals[visual]!.link)) continue;
      this.#project(visual, shot);
      this.#face(visual, shot.eye);
      const ranges = level.ranges[visual]!;
      for (let r = 0; r < ranges.length; r += 2) {
        const [start, count] = [ranges[r]!, ranges[r + 1]!];
        const { colors } = this.#tables;
        drawn += raster.draw(this.#corners, level.index, start, count, colors, () => row, 1, false, 1);
      }
    }
    return drawn;
  }

  /** The visual under a pixel, or -1. Links that are `hidden` can't be picked. */
  pick(x: number, y: number, shot: ShellView, hidden: (link: number) => boolean): number {
    const level = this.#level;
    const { x: xs, y: ys, inverseW: ws } = this.#corners;
    let nearest = 0;
    let found = -1;
    level.ranges.forEach((ranges, visual) => {
      if (ranges.length === 0 || hidden(this.#visuals[visual]!.link)) return;
      this.#project(visual, shot);
      for (let r = 0; r < ranges.length; r += 2) {
        for (let at = ranges[r]!; at < ranges[r]! + ranges[r + 1]!; at += 3) {
          const [i, j, k] = [level.index[at]!, level.index[at + 1]!, level.index[at + 2]!];
          if (ws[i]! <= 0 || ws[j]! <= 0 || ws[k]! <= 0) continue;
          const a = side(xs, ys, i, j, x, y);
          const b = side(xs, ys, j, k, x, y);
          const c = side(xs, ys, k, i, x, y);
          if (!((a >= 0 && b >= 0 && c >= 0) || (a <= 0 && b <= 0 && c <= 0))) continue;
          const whole = a + b + c;
          if (whole === 0) continue;
          const w = (ws[k]! * a + ws[i]! * b + ws[j]! * c) / whole;
          if (w <= nearest) continue;
          nearest = w;
          found = visual;
        }
      }
    });
    return found;
  }

  /** Indices of visuals from near to far, so that most hidden pixels are rejected early. */
  #nearestFirst({ screenFromWorld: view, worldFromLink: world }: ShellView): number[] {
    const { ranges } = this.#level;
    const away = this.#visuals.map(({ link, box }) => {
      const at = link * 16;
      const [x, y, z] = [0, 1, 2].map((i) => (box === null ? 0 : (box.min[i]! + box.max[i]!) / 2)) as [
        number,
        number,
        number,
      ];
      return (
        view[8]! * (world[at]! * x + world[at + 4]! * y + world[at + 8]! * z + world[at + 12]!) +
        view[9]! * (world[at + 1]! * x + world[at + 5]! * y + world[at + 9]! * z + world[at + 13]!) +
        view[10]! * (world[at + 2]! * x + world[at + 6]! * y + world[at + 10]! * z + world[at + 14]!)
      );
    });
    return [...ranges.keys()].filter((i) => ranges[i]!.length > 0).sort((a, b) => away[a]! - away[b]!);
  }

  /** Projects a visual's vertices to the screen, and sets `MESH` to its world_from_mesh. */
  #project(visual: number, { screenFromWorld: view, worldFromLink, near }: ShellView): void {
    const { positions, linkFromMesh } = this.#level;
    multiply(MESH, 0, worldFromLink, this.#visuals[visual]!.link * 16, linkFromMesh, visual * 16);
    for (let row = 0; row < 3; row += 1) {
      for (let column = 0; column < 4; column += 1) {
        let sum = column === 3 ? view[row * 4 + 3]! : 0;
        for (let i = 0; i < 3; i += 1) sum += view[row * 4 + i]! * MESH[column * 4 + i]!;
        ROWS[row * 4 + column] = sum;
      }
    }
    const { x, y, inverseW } = this.#corners;
    const { first, end } = this.#runs[visual]!;
    for (let i = first; i < end; i += 1) {
      const at = i * 4;
      const px = positions[at]!;
      const py = positions[at + 1]!;
      const pz = positions[at + 2]!;
      const w = ROWS[8]! * px + ROWS[9]! * py + ROWS[10]! * pz + ROWS[11]!;
      const inverse = w > near ? 1 / w : 0;
      inverseW[i] = inverse;
      x[i] = (ROWS[0]! * px + ROWS[1]! * py + ROWS[2]! * pz + ROWS[3]!) * inverse;
      y[i] = (ROWS[4]! * px + ROWS[5]! * py + ROWS[6]! * pz + ROWS[7]!) * inverse;
    }
  }

  /** Shades vertices by the lamps, transformed into the mesh's frame so that normals need no rotation (127 is 1). */
  #light(visual: number): void {
    const { normals } = this.#level;
    const { shade } = this.#corners;
    const size = Math.hypot(MESH[0]!, MESH[1]!, MESH[2]!) * 127;
    const lamp = (towards: readonly number[], column: number) =>
      (MESH[column]! * towards[0]! + MESH[column + 1]! * towards[1]! + MESH[column + 2]! * towards[2]!) /
      size;
    const [kx, ky, kz] = [lamp(KEY, 0), lamp(KEY, 4), lamp(KEY, 8)];
    const [fx, fy, fz] = [lamp(FILL, 0), lamp(FILL, 4), lamp(FILL, 8)];
    const [ux, uy, uz] = [MESH[2]! / size, MESH[6]! / size, MESH[10]! / size];
    const { sky, bounce, key, fill } = this.#tones;
    const half = (bounce + sky) / 2;
    const more = (sky - bounce) / 2;
    const { first, end } = this.#runs[visual]!;
    for (let i = first; i < end; i += 1) {
      const at = i * 4;
      const nx = normals[at]!;
      const ny = normals[at + 1]!;
      const nz = normals[at + 2]!;
      const byKey = kx * nx + ky * ny + kz * nz;
      const byFill = fx * nx + fy * ny + fz * nz;
      let light = half + more * (ux * nx + uy * ny + uz * nz);
      if (byKey > 0) light += key * byKey;
      if (byFill > 0) light += fill * byFill;
      shade[i] = Math.min(light * SHADES_PER_LIGHT, SHADES - 1);
    }
  }

  /** Shades vertices by the angle between their surface and the camera. */
  #face(visual: number, eye: Readonly<Vec3>): void {
    const { positions, normals } = this.#level;
    const { shade } = this.#corners;
    const scale = Math.hypot(MESH[0]!, MESH[1]!, MESH[2]!);
    const [dx, dy, dz] = [eye[0] - MESH[12]!, eye[1] - MESH[13]!, eye[2] - MESH[14]!];
    const own = (column: number) =>
      (MESH[column]! * dx + MESH[column + 1]! * dy + MESH[column + 2]! * dz) / (scale * scale);
    const [ex, ey, ez] = [own(0), own(4), own(8)];
    const { first, end } = this.#runs[visual]!;
    for (let i = first; i < end; i += 1) {
      const at = i * 4;
      const x = ex - positions[at]!;
      const y = ey - positions[at + 1]!;
      const z = ez - positions[at + 2]!;
      const along = x * normals[at]! + y * normals[at + 1]! + z * normals[at + 2]!;
      const straight = Math.abs(along) / (127 * Math.sqrt(x * x + y * y + z * z));
      shade[i] = Math.min(1, straight) * (SHADES - 1);
    }
  }
}

const MESH = new Float64Array(16);
const ROWS = new Float64Array(12);

function side(xs: Float32Array, ys: Float32Array, i: number, j: number, x: number, y: number): number {
  return (xs[j]! - xs[i]!) * (y - ys[i]!) - (ys[j]! - ys[i]!) * (x - xs[i]!);
}

/** A level's paints, with each texture replaced by its mean colour. */
function meanPaints(level: Lod, means: readonly (readonly [number, number, number] | null)[]): Float32Array {
  const paints = level.paints.slice();
  for (const { start, picture } of level.draws) {
    const mean = picture === null ? null : means[picture];
    if (mean == null) continue;
    const paint = level.parts[level.index[start]! * 2 + 1]!;
    for (let c = 0; c < 3; c += 1) paints[paint * 4 + c] = paints[paint * 4 + c]! * mean[c]!;
  }
  return paints;
}
