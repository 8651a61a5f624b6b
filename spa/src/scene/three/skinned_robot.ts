import { Matrix4, Object3D, Ray } from 'three';
import { ArticulatedBody } from '../../model/articulated_body.ts';
import { emptyBox, growBox, type LinkBox } from '../../model/bounds.ts';
import { placeLinks } from '../../model/kinematics.ts';
import type { Lod } from '../../model/lod.ts';
import type { Manifest } from '../../model/manifest.ts';
import type { LinkLook, LinkTint } from '../../model/posed_body.ts';
import type { JointValues } from '../../twin/playback/pose.ts';
import { IDENTITY, type Quat, type Vec3 } from '../../twin/rotation.ts';
import type { StagedFigure } from '../figure/figure_node.ts';
import { UNREAD } from '../signs/colors.ts';
import { Ghost } from './ghost.ts';
import { pickPlaceholder, pickVisual } from './raycast.ts';
import { Bones, Skin, type SkinTones } from './skin.ts';
import type { StaleEffect } from './stale_effect.ts';

/** A robot built from a manifest. The manifest is enough to move it; it is drawn once a level of detail has been set with
 *  `wear`. */
export class SkinnedRobot extends ArticulatedBody implements StagedFigure {
  readonly root = new Object3D();
  readonly #linkOfVisual: Int32Array;
  readonly #bones: Bones;
  readonly #staleEffect: StaleEffect;
  readonly #tones: SkinTones;
  #level: Lod | null = null;
  #skin: Skin | null = null;
  #fading = false;
  readonly #tints = new Map<string, LinkTint>();
  #unread: ReadonlySet<string> = new Set();
  readonly #ghosts = new Set<Ghost>();
  readonly #placeholders: { readonly link: number; readonly object: Object3D }[] = [];

  constructor(manifest: Manifest, staleEffect: StaleEffect, tones: SkinTones) {
    super(manifest);
    this.#staleEffect = staleEffect;
    this.#tones = tones;
    this.#bones = new Bones(manifest.visuals.length);
    this.#linkOfVisual = Int32Array.from(manifest.visuals, (visual) => visual.link);
    this.root.matrixAutoUpdate = false;
    this.place([0, 0, 0], IDENTITY);
  }

  override setJoints(joints: JointValues): boolean {
    const changed = super.setJoints(joints);
    if (changed) this.#bend();
    return changed;
  }

  override place(xyz: Vec3, quat_wxyz: Quat): void {
    const [w, x, y, z] = quat_wxyz;
    this.root.position.set(...xyz);
    this.root.quaternion.set(x, y, z, w).normalize();
    this.root.updateMatrix();
    this.root.updateMatrixWorld(true);
    placeLinks(this.root.matrixWorld.elements, this.kinematics.rootFromLink, this.worldFromLink);
  }

  /** The first link that a ray (world) hits, or null. */
  pick(ray: Ray): string | null {
    ROOT_RAY.copy(ray).applyMatrix4(ROOT_FROM_WORLD.copy(this.root.matrixWorld).invert());
    const level = this.#level;
    const visual =
      level === null
        ? -1
        : pickVisual(level, ROOT_RAY, (i, into) => {
            if (this.#bones.isHidden(i)) return false;
            into.fromArray(this.kinematics.rootFromLink, this.#linkOfVisual[i]! * 16);
            into.multiply(LINK.fromArray(level.linkFromMesh, i * 16));
            return true;
          });
    const link = visual < 0 ? pickPlaceholder(this.#placeholders, ROOT_RAY) : this.#linkOfVisual[visual]!;
    return link === null ? null : this.linkNames[link]!;
  }

  setLook(link: string, look: LinkLook): void {
    const wanted = this.linkOf.get(link);
    if (wanted === undefined) return;
    this.#linkOfVisual.forEach((of, visual) => {
      if (of === wanted) this.#bones.setLook(visual, look);
    });
    if ((look.fade ?? 0) > 0 && !this.#fading) {
      this.#fading = true;
      this.#skin?.allowFading();
    }
  }

  setTint(link: string, tint: LinkTint | null): void {
    if (tint === null) this.#tints.delete(link);
    else this.#tints.set(link, tint);
    this.#paint(link);
  }

  markUnread(links: ReadonlySet<string>): void {
    const before = this.#unread;
    this.#unread = links;
    for (const link of new Set([...before, ...links])) this.#paint(link);
  }

  /** Creates a ghost of this robot, which is disposed of with the robot at the latest. */
  ghost(): Ghost {
    const ghost = new Ghost(
      this.manifest.joints,
      this.linkOf,
      this.#linkOfVisual,
      this.#staleEffect,
      this.#tones,
      (gone) => this.#ghosts.delete(gone),
    );
    this.#ghosts.add(ghost);
    this.root.add(ghost.mesh);
    if (this.#level !== null && this.#skin !== null) ghost.wear(this.#level, this.#skin.mesh.geometry);
    return ghost;
  }

  /** Extends a link's box by a mesh's box (in the link's frame, metres) that the manifest lacks. */
  measure(link: number, { min, max }: LinkBox): void {
    const known = this.boxOfLink.get(link);
    const box = known ?? emptyBox();
    growBox(box, [...min, ...max], SAME_FRAME);
    if (known !== undefined) return;
    this.boxOfLink.set(link, box);
    this.boxes.push([this.placed[link]!, box]);
  }

  /** Shows a placeholder in the link's frame instead of a missing mesh. */
  mark(link: number, placeholder: Object3D): void {
    placeholder.matrixAutoUpdate = false;
    this.#placeholders.push({ link, object: placeholder });
    this.root.add(placeholder);
    this.#bend();
  }

  /** Shows a level instead of the previous one, switching between two pictures. */
  wear(level: Lod, pictures: readonly (ImageBitmap | null)[]): void {
    const old = this.#skin;
    this.#level = level;
    this.#skin = new Skin(level, pictures, this.#bones, this.#staleEffect, this.#tones);
    if (this.#fading) this.#skin.allowFading();
    this.#bend();
    this.root.add(this.#skin.mesh);
    for (const ghost of this.#ghosts) ghost.wear(level, this.#skin.mesh.geometry);
    old?.dispose();
  }

  dispose(): void {
    this.root.removeFromParent();
    for (const ghost of [...this.#ghosts]) ghost.dispose();
    this.#skin?.dispose();
    this.#bones.dispose();
  }

  #paint(link: string): void {
    const wanted = this.linkOf.get(link);
    const tint = this.#unread.has(link) ? UNREAD : (this.#tints.get(link) ?? null);
    this.#linkOfVisual.forEach((of, visual) => {
      if (of === wanted) this.#bones.setTint(visual, tint);
    });
  }

  /** Moves meshes and placeholders to match the joints. */
  #bend(): void {
    for (const { link, object } of this.#placeholders) {
      object.matrix.fromArray(this.kinematics.rootFromLink, link * 16).scale(object.scale);
    }
    if (this.#level === null) return;
    this.#bones.follow(this.kinematics.rootFromLink, this.#linkOfVisual, this.#level.linkFromMesh);
  }
}

const SAME_FRAME = new Matrix4().elements;
const LINK = new Matrix4();
const ROOT_RAY = new Ray();
const ROOT_FROM_WORLD = new Matrix4();
