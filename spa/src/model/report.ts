import type { ModelFinding } from './manifest.ts';
import type { MeshFacts } from './mesh_facts.ts';

/** What came of loading a robot's model: shown to people, and read by tests. */
export interface ModelReport {
  /** Mesh URIs (as the URDF writes them) that could not be had; each is drawn as a marked placeholder. */
  missing: string[];
  /** Names of the URDF's joints that can move. */
  joints: string[];
  /** Joints of the newest pose that the URDF does not have; they are ignored. */
  ignored: string[];
  /** One line for each thing that is odd in the URDF or in a mesh and was worked around. */
  problems: string[];
  /** What the edge's doctor says of the model, worst first; nothing for raw files. */
  findings?: readonly ModelFinding[];
  /** What reading the meshes of raw files has told, by the URDF's URI. */
  meshes?: ReadonlyMap<string, MeshFacts>;
  /** Set when only the skeleton can be shown: one line, why. */
  bare?: string;
  /** Set when nothing could be shown: one line, what and where. */
  error?: string;
}
