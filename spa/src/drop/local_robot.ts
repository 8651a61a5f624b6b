import type { BundleFile, RawManifest } from '../scene/bundle.ts';
import { type Diagnosis, diagnose, type Joint, readJoints } from './doctor.ts';
import { DropError, type LocalFiles, tidyPath } from './files.ts';

/** A robot from dropped files, as the scene takes a raw bundle. */
export interface LocalRobot {
  readonly name: string;
  readonly manifest: RawManifest;
  readonly fetch: (file: BundleFile) => Promise<Uint8Array>;
  readonly joints: readonly Joint[];
  readonly diagnoses: readonly Diagnosis[];
}

const MAX_URDF_BYTES = 8_000_000;

/** Finds the URDF among the files and what it names. Throws a DropError of one line. */
export async function openLocal(files: LocalFiles): Promise<LocalRobot> {
  const [path, text] = await findUrdf(files);
  const xml = new DOMParser().parseFromString(text, 'text/xml');
  const complaint = xml.querySelector('parsererror')?.textContent;
  if (complaint != null) {
    const line = /error on line \d+[^\n]*/.exec(complaint)?.[0] ?? complaint.split('\n')[0] ?? '';
    throw new DropError(`${path} is not XML: ${line.trim()}`);
  }
  const robot = xml.documentElement;
  if (robot.nodeName !== 'robot') throw new DropError(`${path} has no <robot>.`);

  const own = { path, uri: path, size: files.get(path)!.size };
  const named = new Map<string, BundleFile>([[path, own]]);
  const missing = new Set<string>();
  const finder = new Finder(files, path);
  for (const mesh of robot.querySelectorAll('visual mesh')) {
    const uri = mesh.getAttribute('filename') ?? '';
    const found = finder.find(uri);
    if (found === null) missing.add(uri);
    else named.set(uri, { path: found, uri, size: files.get(found)!.size });
  }
  return {
    name: robot.getAttribute('name') ?? path,
    manifest: { urdf: own, files: named, missing },
    fetch: (file) => files.get(file.path)!.bytes(),
    joints: readJoints(robot),
    diagnoses: diagnose(robot, [...missing], text),
  };
}

/** The URDF nearest to the top; of several there, the largest. */
async function findUrdf(files: LocalFiles): Promise<[path: string, text: string]> {
  const depth = (path: string) => path.split('/').length;
  const candidates = [...files.keys()]
    .filter((path) => /\.urdf$/i.test(path))
    .sort((a, b) => depth(a) - depth(b) || files.get(b)!.size - files.get(a)!.size);
  const [path] = candidates;
  if (path === undefined) {
    const template = [...files.keys()].find((name) => /\.xacro$/i.test(name));
    if (template !== undefined) throw new DropError(`${template} is a template: run xacro on it first.`);
    throw new DropError('No .urdf among these files.');
  }
  const file = files.get(path)!;
  if (file.size > MAX_URDF_BYTES) throw new DropError(`${path}: over ${MAX_URDF_BYTES / 1e6} MB.`);
  const text = new TextDecoder().decode(await file.bytes());
  // Entities are never needed and the classic way to make a reader choke.
  if (/<!(DOCTYPE|ENTITY)/i.test(text)) throw new DropError(`${path}: a DTD is not accepted.`);
  return [path, text];
}

/** Finds what a URDF names, whatever its package is called: by the longest end of the path that exists. */
class Finder {
  readonly #byLowerCase = new Map<string, string>();
  readonly #folder: string;

  constructor(files: LocalFiles, urdf: string) {
    for (const path of files.keys()) this.#byLowerCase.set(path.toLowerCase(), path);
    this.#folder = urdf.includes('/') ? urdf.slice(0, urdf.lastIndexOf('/')) : '';
  }

  find(uri: string): string | null {
    const bare = decoded(uri.replace(/^(package|file|model):\/*/i, ''));
    const relative = tidyPath(`${this.#folder}/${bare}`);
    const exact = relative === null ? undefined : this.#byLowerCase.get(relative.toLowerCase());
    if (exact !== undefined) return exact;
    const parts = (tidyPath(bare) ?? '').toLowerCase().split('/');
    for (let skip = 0; skip < parts.length; skip += 1) {
      const end = parts.slice(skip).join('/');
      for (const [lower, path] of this.#byLowerCase) {
        if (lower === end || lower.endsWith(`/${end}`)) return path;
      }
    }
    return null;
  }
}

function decoded(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}
