type Triple = readonly [number, number, number];

/** Results of reading a mesh file, for diagnosing a robot's model. */
export interface MeshFacts {
  /** Why there is no mesh; null when there is one. */
  readonly reason: string | null;
  /** Size of the file. */
  readonly bytes: number;
  readonly triangles: number;
  /** Corners of its bounding box in the file's axes, metres, before the URDF's scale. */
  readonly low: Triple;
  readonly high: Triple;
  /** What the reader had to work around. */
  readonly notes: readonly MeshNote[];
}

export type MeshNote = readonly [code: string, text: string];

/** The facts of a mesh that can't be shown, with the reason. */
export function missingMesh(reason: string, bytes = 0): MeshFacts {
  return { reason, bytes, triangles: 0, low: [0, 0, 0], high: [0, 0, 0], notes: [] };
}

/** A mesh as read from its file: the vertices of its parts, metres, and what the reader had to work around. */
interface ReadMesh {
  readonly parts: readonly {
    readonly surface: { readonly positions: ArrayLike<number>; readonly index: ArrayLike<number> };
  }[];
  readonly notes: readonly MeshNote[];
}

/** The facts of a mesh that was read from a file of `bytes` bytes. */
export function factsOf({ parts, notes }: ReadMesh, bytes: number): MeshFacts {
  const low: [number, number, number] = [Infinity, Infinity, Infinity];
  const high: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  let triangles = 0;
  for (const { positions, index } of parts.map(({ surface }) => surface)) {
    triangles += index.length / 3;
    for (let i = 0; i < positions.length; i += 1) {
      const axis = i % 3;
      low[axis] = Math.min(low[axis]!, positions[i]!);
      high[axis] = Math.max(high[axis]!, positions[i]!);
    }
  }
  return { reason: null, bytes, triangles, low, high, notes };
}
