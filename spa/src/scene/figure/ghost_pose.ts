import { linksBeyond } from '../../model/link_tree.ts';
import type { PosedBody } from '../../model/posed_body.ts';
import type { Pose } from '../../twin/playback/pose.ts';

/** A request for a ghost: joints by URDF name, rad or m. With `limbs`, only the links beyond those joints are shown,
 *  and all other joints are as in the body. */
export interface GhostRequest {
  readonly joints: ReadonlyMap<string, number>;
  readonly limbs: readonly string[] | null;
}

/** The joints and links of the ghost; null for no ghost. A whole ghost in the pose takes precedence over a request. */
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
