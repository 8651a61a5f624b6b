import type { ModelFinding } from './manifest.ts';
import type { MeshFacts } from './mesh_facts.ts';

/** The result of loading a robot's model, shown to people and read by tests. */
export interface ModelReport {
  /** Mesh URIs (as written in the URDF) that could not be loaded; each is drawn as a marked placeholder. */
  missing: string[];
  /** Names of the URDF's joints that can move. */
  joints: string[];
  /** Joints of the newest pose that the URDF does not have; they are ignored. */
  ignored: string[];
  /** One line for each thing that is odd in the URDF or in a mesh and was worked around. */
  problems: string[];
  /** What the edge's doctor found in the model, worst first; absent for raw files. */
  findings?: readonly ModelFinding[];
  /** What was learned from reading the meshes of raw files, by the URDF's URI. */
  meshes?: ReadonlyMap<string, MeshFacts>;
  /** Set when only the skeleton can be shown: one line, why. */
  bare?: string;
  /** Set when something did not come for a reason that passes, so that loading it again may help. */
  passing?: boolean;
  /** Set when nothing could be shown: one line, what and where. */
  error?: string;
}
