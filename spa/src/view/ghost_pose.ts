import { linksBeyond } from '../model/link_tree.ts';
import type { PosedBody } from '../model/posed_body.ts';
import type { Pose } from '../twin/playback/pose.ts';

/** A second body that somebody wants to see: joints by URDF name, rad or m. With `limbs`, only what lies beyond those
 *  joints, the others as the body has them. */
export interface GhostRequest {
  readonly joints: ReadonlyMap<string, number>;
  readonly limbs: readonly string[] | null;
}

/** What a ghost shows: a pose that comes with a whole ghost goes before any wish; null is none. */
export function ghostOf(
  body: PosedBody,
  pose: Pose | null,
  wish: GhostRequest | null,
): { joints: ReadonlyMap<string, number>; links: readonly string[] } | null {
  const told = pose?.ghost ?? null;
  if (told !== null) return { joints: told, links: body.linkNames };
  if (wish === null) return null;
  const { joints, limbs } = wish;
  if (limbs === null) return { joints, links: body.linkNames };
  return { joints: new Map([...(pose?.joints ?? []), ...joints]), links: linksBeyond(body, limbs) };
}
