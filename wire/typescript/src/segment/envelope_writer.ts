/** Puts around a header and records what `openEnvelope` checks. */

import { ByteWriter } from './byte_writer.ts';
import { crc32 } from './crc32.ts';
import type { EnvelopeKind } from './envelope.ts';

/** The whole of it. */
export function packEnvelope(
  kind: EnvelopeKind,
  header: Uint8Array,
  records: Uint8Array,
  count: number,
): Uint8Array {
  const all = new ByteWriter();
  all.bytes(Uint8Array.from([...kind.magic, kind.version]));
  all.u32(header.length);
  all.bytes(header);
  all.u32(crc32(all.data));
  all.bytes(records);
  all.byte(0);
  all.u32(count);
  all.u32(crc32(records));
  return all.data.slice();
}
