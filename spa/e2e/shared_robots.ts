/** Real robots in shared/, and the builder that reduces them. */

import { execFileSync, spawnSync } from 'node:child_process';
import path from 'node:path';
import { PYTHON, SHARED } from './stack.ts';

const G1 = 'unitree-g1/example-robot-data/robots/g1_description/urdf';
const EDGE = path.join(path.dirname(PYTHON), 'posecast-edge');

/** URDFs by a short name; any may be absent. */
export const SHARED_ROBOTS: Readonly<Record<string, string>> = Object.fromEntries(
  Object.entries({
    g1: `${G1}/g1_29dof_with_hand_rev_1_0.urdf`,
    hubo: 'hubo2plus-collada/hubo-urdf/model.urdf',
    'hubo-stl': 'hubo2plus-stl/hubo-urdf/model.urdf',
    drchubo: 'drchubo-stl/drchubo-urdf/drchubo-v3.urdf',
  }).map(([name, file]) => [name, path.join(SHARED, 'robots', file)]),
);

export function canBuild(): boolean {
  return spawnSync(EDGE, ['model', 'build', '--help'], { stdio: 'ignore' }).status === 0;
}

export function buildModel(urdf: string, folder: string): void {
  execFileSync(EDGE, ['model', 'build', urdf, '-o', folder], { stdio: 'pipe' });
}
