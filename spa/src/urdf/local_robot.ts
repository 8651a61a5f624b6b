import type { BundleFile, RawFiles, RawManifest } from '../model/bundle.ts';
import { VARIABLES } from '../model/kinematics.ts';
import type { MeshFacts } from '../model/report.ts';
import { diagnose } from './doctor.ts';
import { FileFinder } from './file_finder.ts';
import type { Finding } from './finding.ts';
import { DropError, findOther, type LocalFiles, type OtherRobot, otherFormatOf } from './local_files.ts';
import { parseUrdf } from './reader.ts';
import { readRobotText } from './text.ts';
import { materialOf, SCALAR_TYPES, type Urdf } from './types.ts';
import { XmlRefused } from './xml.ts';

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
/** Other descriptions of robots, of which one is worth a word when there is no URDF. */
const NAMED = /\.(?:usd[acz]?|wbt|proto|srdf)$/i;

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
  // a single file is read whatever its name: it may be the output of a tool, and if not, it is called by its name
  const [likeliest] = paths.filter((path) => files.size === 1 || NAMED.test(path));
  if (likeliest !== undefined) return [likeliest];
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
  const missing = new Map<string, string>();
  const hints = new Map<string, string>();
  const finder = new FileFinder(files, path);
  for (const uri of urisOf(urdf)) {
    const found = finder.find(uri);
    if (found.path === null) missing.set(uri, found.reason);
    else {
      named.set(uri, { path: found.path, uri, size: files.get(found.path)!.size });
      if (found.hint !== null) hints.set(uri, found.hint);
    }
  }
  return {
    name: urdf.name || path,
    path,
    urdf,
    manifest: { urdf: own, files: named, missing: new Set(missing.keys()) },
    files: {
      fetch: (file) => files.get(file.path)!.bytes(),
      beside: async (file, name) => {
        const { path: found } = new FileFinder(files, file.path).find(name);
        return found === null ? null : files.get(found)!.bytes();
      },
    },
    joints: slidersOf(urdf),
    findings: (meshes) => diagnose(urdf, missing, meshes, hints),
  };
}

async function readFile(files: LocalFiles, path: string): Promise<Urdf> {
  const file = files.get(path)!;
  if (file.size > MAX_URDF_BYTES)
    throw new DropError(`${path}: larger than 8 MiB`, { why: 'dropTooLarge', path });
  const bytes = await file.bytes();
  try {
    const text = readRobotText(bytes);
    const format = otherFormatOf(text.text);
    if (format !== null) throw refuseFormat({ path, format });
    return parseUrdf(text);
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
