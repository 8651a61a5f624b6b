import { Unzip, UnzipInflate } from 'fflate';
import { joined } from '../kit.ts';
import {
  DropError,
  type LocalFile,
  type LocalFiles,
  MAX_ALL_BYTES,
  MAX_FILE_BYTES,
  MAX_FILES,
  type Refusal,
  tidyPath,
} from './local_files.ts';

/** File types of models; other members of a zip are not unpacked. */
const WANTED = /\.(urdf|xacro|sdf|world|xml|mjcf|stl|dae|obj|mtl|glb|png|jpe?g)$/i;

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
  const reader = new Unzip((member) => {
    members += 1;
    if (members > MAX_FILES)
      refuse(`The zip has more than ${MAX_FILES} members.`, { why: 'dropTooMany', count: MAX_FILES });
    const path = tidyPath(member.name);
    if (refusal !== null || path === null || !WANTED.test(path)) return; // not started: skipped
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
