import type { ModelFinding } from './manifest.ts';

/** The result of loading a robot's model, shown to people and read by tests. */
export interface ModelReport {
  /** Mesh URIs (as written in the URDF) that could not be loaded; each is drawn as a marked placeholder. */
  missing: string[];
  /** Names of the URDF's joints that can move. */
  joints: string[];
  /** Joints in the newest pose that the URDF does not have; they are ignored. */
  ignored: string[];
  /** One line for each oddity in the URDF or a mesh that was worked around. */
  problems: string[];
  /** What the edge's doctor found in the model, worst first; absent for raw files. */
  findings?: readonly ModelFinding[];
  /** Results of reading the meshes of raw files, by the URI in the URDF. */
  meshes?: ReadonlyMap<string, MeshFacts>;
  /** Set if only the skeleton can be shown: the reason, in one line. */
  bare?: string;
  /** Set if something failed to load for a temporary reason, so that loading again may help. */
  passing?: boolean;
  /** Set if nothing could be shown: one line that says what and where. */
  error?: string;
}

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
