import type { BundleFile, RawFiles, RawManifest } from '../model/bundle.ts';
import { VARIABLES } from '../model/kinematics.ts';
import type { MeshFacts } from '../model/report.ts';
import { diagnose } from './doctor.ts';
import type { Finding } from './finding.ts';
import {
  DropError,
  findOther,
  type LocalFiles,
  type OtherRobot,
  otherFormatOf,
  tidyPath,
} from './local_files.ts';
import { readUrdf } from './reader.ts';
import { materialOf, SCALAR_TYPES, type Urdf } from './types.ts';
import { readXml, XmlRefused } from './xml.ts';

/** A robot from dropped files, in the form of a raw bundle. */
export interface LocalRobot {
  readonly name: string;
  /** The URDF's path among the files. */
  readonly path: string;
  readonly urdf: Urdf;
  readonly manifest: RawManifest;
  /** Reads the meshes and associated files, such as an OBJ's materials. */
  readonly files: RawFiles;
  readonly joints: readonly SliderJoint[];
  /** Its problems, worst first. `meshes`: their facts by URI; null before they are read. */
  findings(meshes: ReadonlyMap<string, MeshFacts> | null): Finding[];
}

/** A joint that a slider can move. */
export interface SliderJoint {
  readonly name: string;
  readonly unit: 'rad' | 'm';
  readonly lower: number;
  readonly upper: number;
}

const MAX_URDF_BYTES = 8 << 20;
const MAX_CHOICES = 50;

/** Paths of the URDFs, the likeliest first: nearest to the top folder, then the largest. Rejects with DropError if there is none;
 *  the error names a robot in a format that only the edge reads, if there is one. */
export async function urdfsIn(files: LocalFiles): Promise<string[]> {
  const depth = (path: string) => path.split('/').length;
  const paths = [...files.keys()].sort(
    (a, b) => depth(a) - depth(b) || files.get(b)!.size - files.get(a)!.size,
  );
  const found = paths.filter((path) => /\.urdf$/i.test(path)).slice(0, MAX_CHOICES);
  if (found.length > 0) return found;
  const other = await findOther(files, paths);
  if (other !== null) throw refuseFormat(other);
  throw new DropError('These files include no .urdf.', { why: 'dropNoUrdf' });
}

function refuseFormat(robot: OtherRobot): DropError {
  return new DropError(`${robot.path} is ${robot.format}`, { why: 'dropOtherFormat', ...robot });
}

/** Reads a URDF and finds the files that it names. Rejects with DropError. */
export async function openLocal(files: LocalFiles, path: string): Promise<LocalRobot> {
  const urdf = await readFile(files, path);
  const own = { path, uri: path, size: files.get(path)!.size };
  const named = new Map<string, BundleFile>([[path, own]]);
  const missing = new Set<string>();
  const finder = new Finder(files, path);
  for (const uri of urisOf(urdf)) {
    const found = finder.find(uri);
    if (found === null) missing.add(uri);
    else named.set(uri, { path: found, uri, size: files.get(found)!.size });
  }
  return {
    name: urdf.name || path,
    path,
    urdf,
    manifest: { urdf: own, files: named, missing },
    files: {
      fetch: (file) => files.get(file.path)!.bytes(),
      beside: async (file, name) => {
        const found = new Finder(files, file.path).find(name);
        return found === null ? null : files.get(found)!.bytes();
      },
    },
    joints: slidersOf(urdf),
    findings: (meshes) => diagnose(urdf, missing, meshes),
  };
}

async function readFile(files: LocalFiles, path: string): Promise<Urdf> {
  const file = files.get(path)!;
  if (file.size > MAX_URDF_BYTES)
    throw new DropError(`${path}: larger than 8 MiB`, { why: 'dropTooLarge', path });
  const text = new TextDecoder().decode(await file.bytes());
  const format = otherFormatOf(text);
  if (format !== null) throw refuseFormat({ path, format });
  try {
    return readUrdf(readXml(text));
  } catch (cause) {
    if (!(cause instanceof XmlRefused)) throw cause;
    const where = cause.line === null ? path : `${path}, line ${cause.line}`;
    throw new DropError(
      `${where}: ${cause.message}`,
      { why: 'dropUnreadable', path: where, what: cause.message },
      { cause },
    );
  }
}

/** URIs of the drawn meshes and of their textures. */
function urisOf(urdf: Urdf): Set<string> {
  const uris = new Set<string>();
  for (const visual of urdf.links.flatMap(({ visuals }) => visuals)) {
    if (visual.shape !== null && visual.shape.uri !== '') uris.add(visual.shape.uri);
    const texture = materialOf(visual, urdf)?.texture ?? null;
    if (texture !== null) uris.add(texture);
  }
  return uris;
}

const REACH = { rad: Math.PI, m: 1 } as const;

/** A slider for every joint except mimic joints; for a rotation in space none. Invalid limits count as none. */
function slidersOf({ joints }: Urdf): SliderJoint[] {
  return joints.flatMap(({ name, type, limit, mimic }): SliderJoint[] => {
    if (type === 'planar' || type === 'floating')
      return VARIABLES[type].slice(0, 3).map(([variable]) => {
        const unit = variable === 'theta' ? 'rad' : 'm';
        return { name: `${name}/${variable}`, unit, lower: -REACH[unit], upper: REACH[unit] };
      });
    if (mimic !== null || !SCALAR_TYPES.has(type)) return [];
    const [lower, upper] = [limit?.lower ?? 0, limit?.upper ?? 0];
    const sound = type !== 'continuous' && lower < upper;
    const unit = type === 'prismatic' ? 'm' : 'rad';
    return [
      {
        name,
        unit,
        lower: sound ? Math.min(lower, 0) : -REACH[unit],
        upper: sound ? Math.max(upper, 0) : REACH[unit],
      },
    ];
  });
}

/** Finds the file that a URI names, regardless of the package name: the one with the longest common path suffix. */
class Finder {
  readonly #byLowerCase = new Map<string, string>();
  /** File name → all paths with that name, also split into parts. */
  readonly #byName = new Map<string, { readonly parts: readonly string[]; readonly path: string }[]>();
  readonly #folder: string;

  constructor(files: LocalFiles, urdf: string) {
    for (const path of files.keys()) this.#byLowerCase.set(path.toLowerCase(), path);
    for (const [lower, path] of this.#byLowerCase) {
      const parts = lower.split('/');
      const name = parts.at(-1)!;
      const namesakes = this.#byName.get(name) ?? [];
      namesakes.push({ parts, path });
      this.#byName.set(name, namesakes);
    }
    this.#folder = urdf.includes('/') ? urdf.slice(0, urdf.lastIndexOf('/')) : '';
  }

  find(uri: string): string | null {
    const bare = decoded(uri.replace(/^(package|file|model):\/*/i, ''));
    const relative = tidyPath(`${this.#folder}/${bare}`);
    const exact = relative === null ? undefined : this.#byLowerCase.get(relative.toLowerCase());
    if (exact !== undefined) return exact;
    const parts = (tidyPath(bare) ?? '').toLowerCase().split('/');
    let best: string | null = null;
    let most = 0;
    for (const { parts: own, path } of this.#byName.get(parts.at(-1)!) ?? []) {
      const same = sameAtEnd(own, parts);
      if (same > most) [best, most] = [path, same];
    }
    return best;
  }
}

function sameAtEnd(a: readonly string[], b: readonly string[]): number {
  let same = 0;
  while (same < a.length && same < b.length && a.at(-1 - same) === b.at(-1 - same)) same += 1;
  return same;
}

function decoded(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}
