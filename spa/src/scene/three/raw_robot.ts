import { isPassing, type RawFiles, type RawManifest } from '../../model/bundle.ts';
import { factsOf, type MeshFacts, type ModelReport, missingMesh } from '../../model/report.ts';
import { modelOf, UrdfError } from '../../urdf/manifest.ts';
import { LodBuilder, type PaintedSurface } from '../../urdf/meshes/lod_builder.ts';
import { ownMesh } from '../../urdf/meshes/primitives.ts';
import { parseUrdf } from '../../urdf/reader.ts';
import { readRobotText } from '../../urdf/text.ts';
import type { Urdf } from '../../urdf/types.ts';
import { XmlRefused } from '../../urdf/xml.ts';
import type { Stage } from './built_robot.ts';
import { MeshLoader } from './mesh_loader.ts';
import { whyAbsent } from './placeholder.ts';
import type { SkinTones } from './skin.ts';
import { SkinnedRobot } from './skinned_robot.ts';
import type { StaleEffect } from './stale_effect.ts';

/** A parsed URDF, with the manifest and the source of its mesh files. */
export interface RawModel {
  readonly urdf: Urdf;
  readonly manifest: RawManifest;
  readonly files: RawFiles;
}

/** Fetches and parses the URDF of a raw bundle. Rejects with a one-line Error. */
export async function fetchUrdf(manifest: RawManifest, files: RawFiles): Promise<Urdf> {
  const bytes = await files.fetch(manifest.urdf);
  try {
    return parseUrdf(readRobotText(bytes));
  } catch (cause) {
    if (!(cause instanceof XmlRefused)) throw cause;
    const where = cause.line === null ? '' : `error on line ${cause.line}: `;
    throw new UrdfError(`URDF: ${where}${cause.message}`, { cause });
  }
}

/** Shows a robot from its raw URDF and meshes, as served by an edge or dropped on the page. `onTotal` gets the total size of the
 *  files to draw. This is a separate chunk, because built models don't need it. */
export async function showRaw(
  { urdf, manifest, files }: RawModel,
  stage: Stage,
  staleEffect: StaleEffect,
  tones: SkinTones,
  report: ModelReport,
  onTotal: (totalBytes: number) => void,
): Promise<void> {
  const model = modelOf(urdf, (uri) => whyAbsent(uri, manifest) === null);
  const robot = new SkinnedRobot(model.manifest, staleEffect, tones);
  const lod = new LodBuilder(model.shapes);
  let worn = 0; // triangles
  const wear = () => {
    if (lod.triangles === worn) return;
    worn = lod.triangles;
    robot.wear(lod.build(), []);
  };
  const slots: Slot[] = [];
  const hasBones = model.shapes.some(({ bones }) => bones !== null);
  for (const [visual, { link, source }] of model.manifest.visuals.entries()) {
    const show = (mesh: readonly PaintedSurface[]) => robot.measure(link, lod.put(visual, mesh));
    const { shape } = model.shapes[visual]!;
    if (shape.kind === 'mesh') {
      slots.push({ link, uri: source, show });
      continue;
    }
    try {
      show(ownMesh(model.shapes[visual]!));
    } catch (cause) {
      report.problems.push(`${source}: ${lineOf(cause)}`);
    }
  }
  wear();
  onTotal(manifest.urdf.size + neededBytes(slots, manifest));
  stage.show(robot);
  report.joints = [...robot.jointNames];
  report.problems.push(...model.problems);

  const meshes = new MeshLoader(files);
  const facts = new Map<string, MeshFacts>();
  report.meshes = facts;
  // From the lowest link up, so that the feet come first and the robot stands right before the rest arrives.
  const worldZ = (link: number) => robot.linkMatrix(robot.linkNames[link]!)!.elements[14]!;
  slots.sort((a, b) => worldZ(a.link) - worldZ(b.link));
  await Promise.all(
    slots.map(async (slot) => {
      const { facts: found, problem, passing } = await fill(slot, manifest, meshes, stage.signal);
      stage.signal.throwIfAborted();
      facts.set(slot.uri, found);
      if (passing) report.passing = true;
      if (problem !== null) {
        if (!hasBones) robot.mark(slot.link, stage.placeholder());
        if (!report.missing.includes(slot.uri)) {
          report.missing.push(slot.uri);
          report.problems.push(problem);
        }
      }
      // Rebuild whenever the triangles have doubled, so that all rebuilds together cost no more than the last one.
      if (lod.triangles >= 2 * worn) wear();
      stage.changed();
    }),
  );
  wear();
  if (slots.length > 0) stage.skinned();
}

/** A visual of the robot that is waiting for its mesh file. */
interface Slot {
  /** The link's index in the manifest. */
  readonly link: number;
  /** The mesh's URI, as written in the URDF. */
  readonly uri: string;
  /** Shows the mesh. Throws MeshError if there is no room for it. */
  show(mesh: readonly PaintedSurface[]): void;
}

/** Loads the mesh of a slot and shows it. `problem`: why that failed, in one line that names the file; `passing`: whether the
 *  cause is temporary. */
async function fill(
  { uri, show }: Slot,
  manifest: RawManifest,
  meshes: MeshLoader,
  signal: AbortSignal,
): Promise<{ facts: MeshFacts; problem: string | null; passing?: boolean }> {
  const absent = whyAbsent(uri, manifest);
  if (absent !== null) return { facts: missingMesh(absent), problem: `${uri}: ${absent}` };
  const file = manifest.files.get(uri)!;
  const named = `${file.path}: `;
  try {
    const mesh = await meshes.load(file);
    if (!signal.aborted) show(mesh.parts);
    return { facts: factsOf(mesh, file.size), problem: null };
  } catch (cause) {
    const problem = lineOf(cause);
    const reason = problem.startsWith(named) ? problem.slice(named.length) : problem;
    return { facts: missingMesh(reason, file.size), problem: named + reason, passing: isPassing(cause) };
  }
}

function lineOf(cause: unknown): string {
  return cause instanceof Error ? cause.message : String(cause);
}

function neededBytes(slots: readonly Slot[], manifest: RawManifest): number {
  const sizes = new Map<string, number>();
  for (const { uri } of slots) {
    const file = manifest.files.get(uri);
    if (file !== undefined && whyAbsent(uri, manifest) === null) sizes.set(file.path, file.size);
  }
  return [...sizes.values()].reduce((sum, size) => sum + size, 0);
}
