import { Unzip, UnzipInflate } from 'fflate';
import { joined } from '../kit.ts';
import { listZip, ZipError } from '../zip.ts';
import {
  DropError,
  isResourceFork,
  type LocalFile,
  type LocalFiles,
  MAX_ALL_BYTES,
  MAX_FILE_BYTES,
  MAX_FILES,
  type Refusal,
  tidyPath,
} from './local_files.ts';
import { decodedAs } from './text.ts';

/** File types of models; other members of a zip are not unpacked, only known by name. */
const WANTED = /\.(urdf|xacro|sdf|world|xml|config|mjcf|srdf|stl|dae|obj|mtl|glb|gltf|ply|png|jpe?g)$/i;
/** Ways of packing that are not supported, by their numbers. */
const METHODS: Readonly<Record<number, string>> = {
  ...{ 9: 'Deflate64', 12: 'bzip2', 14: 'LZMA', 93: 'Zstandard', 95: 'xz', 98: 'PPMd' },
};
const UTF8_FLAG = 1 << 11;

/** Bytes unpacked at a time: each piece may grow a thousandfold before it can be refused. */
const PIECE = 2048;
/** A zip that grows by more than this factor is considered malicious: meshes compress to a tenth, pictures hardly at all. */
const MAX_GROWTH = 100;
const GROWTH_COUNTS_FROM = 4_000_000;

/**
 * Unpacks a zip piece by piece. Sizes declared in the zip are ignored: bytes are counted as they come out, and a zip that unpacks
 * to too much is refused at once. Rejects with DropError.
 */
export async function unzip(file: Blob): Promise<LocalFiles> {
  const found = new Map<string, LocalFile>();
  let members = 0;
  let total = 0;
  let read = 0;
  let refusal: DropError | null = null;
  const refuse = (message: string, why: Refusal) => {
    refusal ??= new DropError(message, why);
  };
  const names = await namesOf(file);
  const reader = new Unzip((member) => {
    members += 1;
    if (members > MAX_FILES)
      refuse(`The zip has more than ${MAX_FILES} members.`, { why: 'dropTooMany', count: MAX_FILES });
    const path = tidyPath(names.get(member.name) ?? member.name);
    if (refusal !== null || path === null || isResourceFork(path)) return; // not started: skipped
    if (!WANTED.test(path)) {
      if (path !== '' && !member.name.endsWith('/')) found.set(path, unread(path));
      return;
    }
    if (member.compression !== 0 && member.compression !== 8) {
      const method = METHODS[member.compression] ?? `method ${member.compression}`;
      const what = `packed with ${method}, which is not supported: pack the folder as an ordinary zip (Deflate)`;
      refuse(`${path}: ${what}`, { why: 'dropUnreadable', path, what });
      return;
    }
    const pieces: Uint8Array[] = [];
    let size = 0;
    member.ondata = (error, piece, final) => {
      if (refusal !== null) return;
      if (error !== null) {
        refuse(`The zip is damaged at ${path}.`, { why: 'dropDamaged' });
        return;
      }
      size += piece.length;
      total += piece.length;
      const why =
        total > GROWTH_COUNTS_FROM + read * MAX_GROWTH
          ? `to over ${MAX_GROWTH} times its size`
          : size > MAX_FILE_BYTES || total > MAX_ALL_BYTES
            ? 'to more than a robot has'
            : null;
      if (why !== null) {
        found.clear();
        pieces.length = 0;
        refuse(`The zip unpacks ${why}, at ${path}.`, { why: 'dropBomb', path });
        return;
      }
      pieces.push(piece);
      if (final) found.set(path, { size, bytes: async () => joined(pieces, size) });
    };
    member.start();
  });
  reader.register(UnzipInflate);
  const source = file.stream().getReader();
  try {
    for (;;) {
      const { done, value } = await source.read();
      // Small pieces, so that a bomb is noticed before much of it is unpacked.
      for (let at = 0; at < (value?.length ?? 0) && refusal === null; at += PIECE) {
        const piece = value!.subarray(at, at + PIECE);
        read += piece.length;
        reader.push(piece, false);
      }
      if (refusal !== null) throw refusal;
      if (done) break;
    }
    reader.push(new Uint8Array(), true);
  } catch (cause) {
    if (cause instanceof DropError) throw cause;
    throw new DropError('The zip is damaged.', { why: 'dropDamaged' }, { cause });
  } finally {
    void source.cancel().catch(() => {});
  }
  if (refusal !== null) throw refusal;
  if (members === 0) throw new DropError('This is not a zip file.', { why: 'dropNoZip' });
  return found;
}

/** A member that is known by name only. */
function unread(path: string): LocalFile {
  return { size: 0, bytes: () => Promise.reject(new Error(`${path} is not unpacked`)) };
}

/** The names of a zip's members, by what fflate makes of them. A name that is not marked as UTF-8 may be in it nevertheless, or in
 *  GBK, as on a Chinese Windows. */
async function namesOf(file: Blob): Promise<Map<string, string>> {
  const names = new Map<string, string>();
  const entries = await listZip(file, MAX_FILES).catch((cause: unknown) => {
    if (cause instanceof ZipError) return []; // what is wrong with it is found when it is unpacked
    throw cause;
  });
  for (const { name, flags } of entries) {
    if ((flags & UTF8_FLAG) !== 0) continue;
    const proper = decodedAs('utf-8', name) ?? decodedAs('gb18030', name);
    if (proper !== null) names.set(String.fromCharCode(...name), proper);
  }
  return names;
}
