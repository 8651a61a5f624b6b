import type { RawFiles, RawManifest } from '../../model/bundle.ts';
import { factsOf, type MeshFacts, missingMesh } from '../../model/mesh_facts.ts';
import type { ModelReport } from '../../model/report.ts';
import type { Stage } from '../robot/figure.ts';
import type { SkinTones } from '../robot/skin.ts';
import type { StaleEffect } from '../robot/stale_effect.ts';
import { MeshLoader } from './mesh_loader.ts';
import { Palette } from './palette.ts';
import { whyAbsent } from './placeholder.ts';
import { type MeshSlot, UrdfRobot } from './urdf_robot.ts';

/** Shows a robot from its raw URDF and meshes, `onTotal` hearing how many bytes it draws: for an edge that serves them as they are, and for a dropped folder.
 *  A chunk of its own, because a built model needs none of it. */
export async function showRaw(
  manifest: RawManifest,
  files: RawFiles,
  stage: Stage,
  staleEffect: StaleEffect,
  { accent }: SkinTones,
  report: ModelReport,
  onTotal: (totalBytes: number) => void,
): Promise<void> {
  const urdf = new TextDecoder().decode(await files.fetch(manifest.urdf));
  stage.signal.throwIfAborted();
  const model = new UrdfRobot(urdf, new Palette(staleEffect, accent));
  onTotal(manifest.urdf.size + neededBytes(model.slots, manifest));
  stage.show(model);
  report.joints = model.jointNames;
  report.problems.push(...model.problems);

  const meshes = new MeshLoader(files);
  const facts = new Map<string, MeshFacts>();
  report.meshes = facts;
  // From the floor up: so the feet are known, and the robot stands, before the rest arrives.
  const slots = [...model.slots].sort((a, b) => a.worldZ - b.worldZ);
  await Promise.all(
    slots.map(async (slot) => {
      const { facts: found, problem } = await fill(slot, manifest, meshes, stage.signal);
      stage.signal.throwIfAborted();
      facts.set(slot.uri, found);
      if (problem !== null) {
        slot.mark(stage.placeholder());
        if (!report.missing.includes(slot.uri)) {
          report.missing.push(slot.uri);
          report.problems.push(problem);
        }
      }
      stage.changed();
    }),
  );
  if (slots.length > 0) stage.skinned();
}

/** Puts the mesh into its slot. `problem`: why it can't, in one line that names the file. */
async function fill(
  slot: MeshSlot,
  manifest: RawManifest,
  meshes: MeshLoader,
  signal: AbortSignal,
): Promise<{ facts: MeshFacts; problem: string | null }> {
  const absent = whyAbsent(slot.uri, manifest);
  if (absent !== null) return { facts: missingMesh(absent), problem: `${slot.uri}: ${absent}` };
  const file = manifest.files.get(slot.uri)!;
  try {
    const mesh = await meshes.load(file);
    if (!signal.aborted) slot.fill(mesh.parts);
    return { facts: factsOf(mesh, file.size), problem: null };
  } catch (cause) {
    const problem = cause instanceof Error ? cause.message : String(cause);
    const named = `${file.path}: `;
    const reason = problem.startsWith(named) ? problem.slice(named.length) : problem;
    return { facts: missingMesh(reason, file.size), problem };
  }
}

function neededBytes(slots: readonly MeshSlot[], manifest: RawManifest): number {
  const sizes = new Map<string, number>();
  for (const { uri } of slots) {
    const file = manifest.files.get(uri);
    if (file !== undefined && whyAbsent(uri, manifest) === null) sizes.set(file.path, file.size);
  }
  return [...sizes.values()].reduce((sum, size) => sum + size, 0);
}
