/** A link of the model, its parent link and the joint between them. */
export interface TreeLink {
  readonly link: string;
  /** null for the root. */
  readonly parent: string | null;
  /** The joint that moves it; null for the root and for a link fixed to its parent. */
  readonly joint: string | null;
}

/** Which joint moves which links, for any kind of model. Names are those of the URDF. */
export class KinematicTree {
  readonly #links: ReadonlyMap<string, TreeLink>;
  readonly #linkOf: ReadonlyMap<string, string>;

  constructor(links: readonly TreeLink[]) {
    this.#links = new Map(links.map((entry) => [entry.link, entry]));
    this.#linkOf = new Map(links.flatMap(({ joint, link }) => (joint === null ? [] : [[joint, link]])));
  }

  /** Movable joints, parents before children. */
  get joints(): readonly string[] {
    return [...this.#linkOf.keys()];
  }

  /** The child link of a joint, whose origin is at the joint; null for a joint that the model lacks. */
  linkOf(joint: string): string | null {
    return this.#linkOf.get(joint) ?? null;
  }

  /** The links that a joint moves as one rigid body: its child link and all links fixed to it. */
  bodyOf(joint: string): string[] {
    return [...this.#links.keys()].filter((link) => this.jointOf(link) === joint);
  }

  /** The joint that moves a link or the link it is fixed to; null if no joint moves it. */
  jointOf(link: string): string | null {
    const entry = this.#links.get(link);
    if (entry === undefined) return null;
    return entry.joint ?? (entry.parent === null ? null : this.jointOf(entry.parent));
  }

  /** The next joint on the way to the root; null if there is none. */
  before(joint: string): string | null {
    const parent = this.#links.get(this.linkOf(joint) ?? '')?.parent ?? null;
    return parent === null ? null : this.jointOf(parent);
  }
}
