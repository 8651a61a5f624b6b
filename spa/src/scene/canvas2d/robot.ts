import { ArticulatedBody, type PlacedLink } from '../../model/articulated_body.ts';
import type { LinkBox } from '../../model/bounds.ts';
import { Kinematics, placeLinks } from '../../model/kinematics.ts';
import type { Lod } from '../../model/lod.ts';
import type { Manifest } from '../../model/manifest.ts';
import type { LinkLook, LinkTint } from '../../model/posed_body.ts';
import type { Quat, Vec3 } from '../../twin/rotation.ts';
import type { FigureGhost, StagedFigure } from '../figure/figure_node.ts';
import { UNREAD } from '../signs/colors.ts';
import type { LightColors } from './colors.ts';
import type { Rasterizer } from './rasterizer.ts';
import { type LinkPaint, Shells, type ShellView } from './shells.ts';

/** Near clipping distance as a fraction of the robot's size. */
const NEAR = 0.02;

/** The ghost: the same robot in another pose. */
interface SecondBody {
  readonly worldFromLink: Float64Array;
  /** The links that are drawn. */
  readonly links: Set<number>;
  /** Computes the poses of its links in the world. */
  spread(): void;
}

/** A built robot in the light view, with the same manifest, kinematics, overlay and coarsest level as in 3D. */
export class LightRobot extends ArticulatedBody implements StagedFigure {
  readonly root: PlacedLink;
  readonly #looks = new Map<number, LinkLook>();
  readonly #tints = new Map<number, LinkTint>();
  /** Links whose place is unknown, because their joints have no reading. */
  #unreadLinks: ReadonlySet<number> = new Set();
  #ghost: SecondBody | null = null;
  #shells: Shells | null = null;
  #tones: LightColors;
  #near = 0.01;
  /** Offset along y of this robot among others, metres; takes effect at the next `place` or `ground`. */
  aside = 0;

  constructor(manifest: Manifest, tones: LightColors) {
    super(manifest);
    this.#tones = tones;
    this.root = this.placed[0]!;
    this.ground();
  }

  /** Whether a level has been set with `wear`. */
  get dressed(): boolean {
    return this.#shells !== null;
  }

  /** The position of the root, metres. */
  get spot(): { readonly x: number; readonly y: number } {
    return { x: this.worldFromLink[12]!, y: this.worldFromLink[13]! };
  }

  get hasGhost(): boolean {
    return this.#ghost !== null;
  }

  override place([x, y, z]: Vec3, quat_wxyz: Quat): void {
    super.place([x, y + this.aside, z], quat_wxyz);
    this.#ghost?.spread();
  }

  /** Makes the ghost; there is one at a time. */
  ghost(): FigureGhost {
    const kinematics = new Kinematics(this.manifest.joints);
    const worldFromLink = new Float64Array(this.worldFromLink.length);
    const links = new Set(this.linkNames.keys());
    const spread = () => placeLinks(this.root.matrixWorld.elements, kinematics.rootFromLink, worldFromLink);
    const ghost = { worldFromLink, links, spread };
    spread();
    this.#ghost = ghost;
    return {
      setJoints: (joints, instead) => {
        if (!kinematics.set(joints, instead)) return false;
        kinematics.compute();
        spread();
        return true;
      },
      setLook: (name, { hide = false }) => {
        const link = this.linkOf.get(name)!;
        if (hide) links.delete(link);
        else links.add(link);
      },
      dispose: () => {
        if (this.#ghost === ghost) this.#ghost = null;
      },
    };
  }

  /** Sets how a link is shown. True if the model has this link. */
  setLook(link: string, look: LinkLook): boolean {
    const i = this.linkOf.get(link);
    if (i === undefined) return false;
    this.#looks.set(i, look);
    return true;
  }

  setTint(link: string, tint: LinkTint | null): void {
    const i = this.linkOf.get(link);
    if (i === undefined) return;
    if (tint === null) this.#tints.delete(i);
    else this.#tints.set(i, tint);
  }

  markUnread(links: ReadonlySet<string>): void {
    this.#unreadLinks = new Set([...links].map((name) => this.linkOf.get(name) ?? -1));
  }

  setTones(tones: LightColors): void {
    this.#tones = tones;
    this.#shells?.setTones(tones);
  }

  dispose(): void {
    this.#ghost = this.#shells = null;
  }

  /** Shows a level. `pictures`: the mean colour (linear) of each of its textures; null for one that can't be read. */
  wear(level: Lod, pictures: readonly (readonly [number, number, number] | null)[]): void {
    this.#shells = new Shells(level, pictures, this.manifest.visuals, this.#tones);
  }

  override bounds(): LinkBox {
    const { min, max } = super.bounds();
    this.#near = Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]) * NEAR;
    return { min, max };
  }

  /** Draws its meshes; returns how many triangles were on the screen. `screenFromWorld`: as in `CameraRig`, in pixels.
   *  */
  draw(raster: Rasterizer, screenFromWorld: Float64Array): number {
    const shot = this.#shot(screenFromWorld, NOWHERE);
    return this.#shells?.draw(raster, shot, (link) => this.#paintOf(link)) ?? 0;
  }

  /** Draws the ghost, seen from `eye` (world); returns its triangles on the screen, 0 without a ghost. */
  drawGhost(raster: Rasterizer, screenFromWorld: Float64Array, eye: Readonly<Vec3>): number {
    if (this.#ghost === null) return 0;
    const { worldFromLink, links } = this.#ghost;
    const shot = { ...this.#shot(screenFromWorld, eye), worldFromLink };
    return this.#shells?.drawGlass(raster, shot, links) ?? 0;
  }

  /** The link under a pixel, or null. */
  pick(x: number, y: number, screenFromWorld: Float64Array): string | null {
    const shot = this.#shot(screenFromWorld, NOWHERE);
    const hidden = (link: number) => this.#looks.get(link)?.hide === true;
    const found = this.#shells?.pick(x, y, shot, hidden) ?? -1;
    return found < 0 ? null : this.linkNames[this.manifest.visuals[found]!.link]!;
  }

  #shot(screenFromWorld: Float64Array, eye: Readonly<Vec3>): ShellView {
    return { screenFromWorld, eye, worldFromLink: this.worldFromLink, near: this.#near };
  }

  #paintOf(link: number): LinkPaint {
    const tint = this.#unreadLinks.has(link) ? UNREAD : (this.#tints.get(link) ?? null);
    return { look: this.#looks.get(link) ?? {}, tint };
  }
}

const NOWHERE: Vec3 = [0, 0, 0];
