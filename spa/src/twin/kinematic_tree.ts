/** A link of the model, and how it hangs on the one before it. */
export interface TreeLink {
  readonly link: string;
  /** null for the root. */
  readonly parent: string | null;
  /** The joint that moves it; null for the root, and for what is fixed to its parent. */
  readonly joint: string | null;
}

/** Which joint moves which links, whatever the model was read from. Names as in the URDF. */
export class KinematicTree {
  readonly #links: ReadonlyMap<string, TreeLink>;
  readonly #linkOf: ReadonlyMap<string, string>;

  constructor(links: readonly TreeLink[]) {
    this.#links = new Map(links.map((entry) => [entry.link, entry]));
    this.#linkOf = new Map(links.flatMap(({ joint, link }) => (joint === null ? [] : [[joint, link]])));
  }

  /** Joints that move, parents before children. */
  get joints(): readonly string[] {
    return [...this.#linkOf.keys()];
  }

  /** The link whose origin is where the joint sits; null for a joint that the model does not have. */
  linkOf(joint: string): string | null {
    return this.#linkOf.get(joint) ?? null;
  }

  /** All that the joint moves as one body: its link, and what is fixed to that. */
  bodyOf(joint: string): string[] {
    return [...this.#links.keys()].filter((link) => this.jointOf(link) === joint);
  }

  /** The joint that moves a link, or what it is fixed to; null for what no joint moves. */
  jointOf(link: string): string | null {
    const entry = this.#links.get(link);
    if (entry === undefined) return null;
    return entry.joint ?? (entry.parent === null ? null : this.jointOf(entry.parent));
  }

  /** The joint before this one on the way to the root. */
  before(joint: string): string | null {
    const parent = this.#links.get(this.linkOf(joint) ?? '')?.parent ?? null;
    return parent === null ? null : this.jointOf(parent);
  }
}
