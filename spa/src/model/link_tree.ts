import { KinematicTree } from '../twin/kinematic_tree.ts';
import type { PosedBody } from './posed_body.ts';

type Tree = Pick<PosedBody, 'jointNames' | 'linkNames' | 'joint' | 'bones'>;

/** The kinematic tree of a body: its links, each with its parent and the joint that moves it. */
export function treeOf(body: Tree): KinematicTree {
  const moved = new Map<string, string>();
  for (const name of body.jointNames) {
    const link = body.joint(name)?.link;
    if (link !== undefined) moved.set(link, name);
  }
  const parents = new Map([...body.bones()].map(([parent, child]) => [child, parent]));
  const links = body.linkNames.map((link) => ({
    link,
    parent: parents.get(link) ?? null,
    joint: moved.get(link) ?? null,
  }));
  return new KinematicTree(links);
}

/** For each link, the joint that moves it or moves the link it is fixed to; null if no joint moves it. */
export function jointOfLinks(body: Tree): Map<string, string | null> {
  const tree = treeOf(body);
  return new Map(body.linkNames.map((link) => [link, tree.jointOf(link)]));
}

/** The child links of these joints and the links fixed to them. */
export function linksMovedBy(body: Tree, joints: ReadonlySet<string>): Set<string> {
  const moved = new Set<string>();
  for (const [link, joint] of jointOfLinks(body)) if (joint !== null && joints.has(joint)) moved.add(link);
  return moved;
}

/** The child links of these joints and all links below them, including those beyond further joints; in the model's order. */
export function linksBeyond(body: Tree, joints: readonly string[]): string[] {
  const moved = new Set(joints.map((name) => body.joint(name)?.link));
  const parents = new Map([...body.bones()].map(([parent, child]) => [child, parent]));
  const isMoved = (link: string | undefined): boolean =>
    link !== undefined && (moved.has(link) || isMoved(parents.get(link)));
  return body.linkNames.filter((link) => isMoved(link));
}
