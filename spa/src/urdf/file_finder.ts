import { quoted } from './finding.ts';
import { type LocalFiles, tidyPath } from './local_files.ts';

/** What a name in a model leads to: a file, and how it was found if the name was not quite right; or why there is none. */
export type Found =
  | { readonly path: string; readonly hint: string | null }
  | { readonly path: null; readonly reason: string };

const MESHES = ['stl', 'dae', 'obj', 'glb', 'gltf', 'ply'];
const BESIDE = ['mtl', 'png', 'jpg', 'jpeg', 'bmp', 'tga', 'tif', 'tiff', 'webp', 'gif', 'dds', 'bin'];
const KNOWN: ReadonlySet<string> = new Set([...MESHES, ...BESIDE]);
const MARKERS = ['package.xml', 'model.config'];
const LEVELS_UP = 4; // parents of the model's folder in which its package's file is looked for
const MAX_LETTERS = 4096;
const MAX_PARTS = 32;
const SCHEME = /^([A-Za-z][A-Za-z0-9+.-]+):([\s\S]*)$/; // one letter is a disk, as in C:/…
const DISK = /^\/*[A-Za-z]:\//;

/**
 * Finds the file that a model names among the dropped ones, as the edge does (posecast_edge.model.urdf.resolver): by the name as
 * written, then unquoted, each also in other letters, then by the end of its path. Packages need no `package.xml` here, because
 * all files are the user's own choice.
 */
export class FileFinder {
  readonly #files: LocalFiles;
  readonly #byFolded = new Map<string, string>();
  /** Folded file name → all paths with that name, split into parts. */
  readonly #byName = new Map<string, { readonly parts: readonly string[]; readonly path: string }[]>();
  readonly #folder: string;
  readonly #tops: ReadonlySet<string>;

  /** `from`: path of the file that names others. */
  constructor(files: LocalFiles, from: string) {
    this.#files = files;
    for (const path of [...files.keys()].sort().reverse()) this.#byFolded.set(folded(path), path);
    for (const path of files.keys()) {
      const parts = folded(path).split('/');
      const name = parts.at(-1)!;
      const namesakes = this.#byName.get(name) ?? [];
      namesakes.push({ parts, path });
      this.#byName.set(name, namesakes);
    }
    this.#folder = folderOf(from);
    this.#tops = new Set([this.#folder, this.#packageAround() ?? this.#folder]);
  }

  find(uri: string): Found {
    const [scheme, name] = splitScheme(uri);
    if (uri.includes('\0') || uri.length > MAX_LETTERS || name.split(/[/\\]/).length > MAX_PARTS)
      return { path: null, reason: 'not a file name' };
    if (!['', 'file', 'package', 'model'].includes(scheme))
      return { path: null, reason: `${scheme}: files are not downloaded` };
    if ((scheme === 'package' || scheme === 'model') && !/^[/\\]*[^/\\]+[/\\]+[^/\\]/.test(name))
      return { path: null, reason: 'not a file name in a package' };
    const names = spellings(name);
    const looked: string[] = [];
    let refused: Found | null = null;
    const accept = (path: string, hint: string | null): Found | null => {
      if (KNOWN.has(suffixOf(path))) return { path, hint };
      const suffix = quoted(suffixOf(path) === '' ? '' : path.slice(path.lastIndexOf('.')));
      refused ??= { path: null, reason: `${suffix} is not a supported mesh or picture format` };
      return null;
    };
    for (const place of names.flatMap((one) => this.#placesOf(scheme, one))) {
      const found = this.#look(place);
      if (found === null) looked.push(place);
      else {
        const other = found !== place && found.normalize('NFC') !== place.normalize('NFC');
        const last = quoted(found.slice(found.lastIndexOf('/') + 1));
        const hint = other ? `the file is called ${last}, in other upper and lower case` : null;
        const taken = accept(found, hint ?? (uri.includes('\\') ? 'written with backslashes' : null));
        if (taken !== null) return taken;
      }
    }
    for (const one of names) {
      const found = this.#findByEnd(one);
      if (found === null) continue;
      const whole = scheme !== '' && scheme !== 'file' && `/${found}`.endsWith(`/${one.replace(/^\/+/, '')}`);
      const hint = `not where it says; ${quoted(found)} is taken from the model's own folder`;
      const taken = accept(found, whole ? null : hint);
      if (taken !== null) return taken;
    }
    const places = [...new Set(looked)].slice(0, 2).map((place) => quoted(place));
    const last = names.at(-1)!.split('/').at(-1)!;
    const where = [...places, `any ${quoted(last)} in the robot's folder`].join(' and ');
    return refused ?? { path: null, reason: `no such file; looked for ${where}` };
  }

  /** The folder of the package that the model is in; null without one. */
  #packageAround(): string | null {
    let at = this.#folder;
    for (let n = 0; n <= LEVELS_UP; n += 1) {
      if (MARKERS.some((marker) => this.#files.has(joinedPath(at, marker)))) return at;
      if (at === '') return null;
      at = folderOf(at);
    }
    return null;
  }

  /** Where a file of that name may be; nowhere for a path on another computer's disk. */
  #placesOf(scheme: string, name: string): string[] {
    if (scheme === 'package' || scheme === 'model') {
      const [, wanted = '', inside = ''] = /^\/*([^/]*)\/*([\s\S]*)$/.exec(name) ?? [];
      const package_ = this.#packageAround();
      const own = package_ !== null && folded(package_.split('/').at(-1)!) === folded(wanted);
      return own ? [tidyPath(joinedPath(package_, inside)) ?? ''].filter(Boolean) : [];
    }
    const path = scheme === 'file' ? name.replace(/^\/\/localhost(?=\/)/, '').replace(/^\/\//, '') : name;
    if (DISK.test(path) || path.startsWith('/')) return [];
    const tidy = tidyPath(joinedPath(this.#folder, path));
    return tidy === null ? [] : [tidy];
  }

  #look(path: string): string | null {
    return this.#files.has(path) ? path : (this.#byFolded.get(folded(path)) ?? null);
  }

  /** The file whose path ends like this name with the most parts. One part is enough only beside the model's file and in its
   *  package's folder: a name like link.stl may be anywhere. */
  #findByEnd(name: string): string | null {
    const parts = folded(name.replace(DISK, ''))
      .split('/')
      .filter((part) => !['', '.', '..'].includes(part));
    let best: { end: number; own: readonly string[]; path: string } | null = null;
    for (const { parts: own, path } of this.#byName.get(parts.at(-1) ?? '') ?? []) {
      const end = commonEnd(own, parts);
      if (end < 2 && !this.#tops.has(folderOf(path))) continue;
      const better =
        best === null ||
        end > best.end ||
        (end === best.end &&
          (own.length < best.own.length ||
            (own.length === best.own.length && own.join('/') < best.own.join('/'))));
      if (better) best = { end, own, path };
    }
    return best?.path ?? null;
  }
}

/** The names that may be meant: as written, unquoted (%20), and without the query or fragment of a URI. */
function spellings(name: string): string[] {
  const plain = name.replaceAll('\\', '/');
  return [...new Set([plain, unquoted(plain), unquoted(plain.split(/[?#]/, 1)[0]!) || plain])];
}

/** The name with each `%20` and the like replaced, as far as they are UTF-8. */
function unquoted(text: string): string {
  return text.replace(/(?:%[0-9a-f]{2})+/gi, (some) =>
    new TextDecoder().decode(Uint8Array.from(some.slice(1).split('%'), (hex) => Number.parseInt(hex, 16))),
  );
}

/** For comparison: in lower case, and with each accented letter as one character. */
function folded(name: string): string {
  return name.normalize('NFC').toUpperCase().toLowerCase().normalize('NFC');
}

function splitScheme(uri: string): [scheme: string, name: string] {
  const found = SCHEME.exec(uri);
  return found === null ? ['', uri] : [found[1]!.toLowerCase(), found[2]!];
}

function suffixOf(path: string): string {
  return /[^/]\.([^./]+)$/.exec(path)?.[1]?.toLowerCase() ?? '';
}

function folderOf(path: string): string {
  return path.includes('/') ? path.slice(0, path.lastIndexOf('/')) : '';
}

function joinedPath(folder: string, name: string): string {
  return folder === '' ? name : `${folder}/${name}`;
}

function commonEnd(a: readonly string[], b: readonly string[]): number {
  let same = 0;
  while (same < a.length && same < b.length && a.at(-1 - same) === b.at(-1 - same)) same += 1;
  return same;
}
