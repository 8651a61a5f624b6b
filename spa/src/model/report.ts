import type { ModelFinding } from './manifest.ts';
import type { MeshFacts } from './mesh_facts.ts';

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
