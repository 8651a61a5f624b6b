/** The frame's header, which is the only part of a frame that a relay reads. */

export const WIRE_VERSION = 1;
export const KEY_HEADER_BYTES = 17;
export const HEADER_BYTES = 9;
export const TAG_KEY = 0x13;
const TAG_RESERVED = 0x12; // REF, a second kind of base, which no agent ever sent
export const TAG_PLAIN = 0x10;
export const FRAME_BYTES_MAX = 1 << 16; // 4096 channels of the widest codes fit

/** A frame that cannot be decoded; it changed nothing. */
export class FrameError extends Error {}

/** Not a frame of wire format 1, or a damaged one. */
export class BadFrame extends FrameError {
  override readonly name = 'BadFrame';
}

/** Sound as far as can be seen, but its schema or base is not here. */
export class BaseUnknown extends FrameError {
  override readonly name = 'BaseUnknown';
}

export type Header =
  /** `t`: s, robot clock. */
  | { readonly isKey: true; readonly schemaId: number; readonly seq: number; readonly t: number }
  /** Distances from the base; `ms` of robot time. */
  | { readonly isKey: false; readonly baseId: number; readonly distance: number; readonly ms: number };

/** Read a frame's header. BadFrame when it is none. The body is not looked at. */
export function parseHeader(frame: Uint8Array): Header {
  if (frame.length === 0) throw new BadFrame('empty frame');
  if (frame.length > FRAME_BYTES_MAX)
    throw new BadFrame(`frame of ${frame.length} bytes, ${FRAME_BYTES_MAX} allowed`);
  const tag = frame[0]!;
  if (tag >> 4 !== WIRE_VERSION) throw new BadFrame(`version ${tag >> 4}, this reader knows ${WIRE_VERSION}`);
  const view = new DataView(frame.buffer, frame.byteOffset, frame.byteLength);
  if (tag === TAG_KEY) {
    if (frame.length <= KEY_HEADER_BYTES) throw new BadFrame(`KEY of ${frame.length} bytes`);
    const t = view.getFloat64(9, true);
    if (!Number.isFinite(t)) throw new BadFrame('KEY without a time');
    return { isKey: true, schemaId: view.getUint32(1, true), seq: view.getUint32(5, true), t };
  }
  if (tag === TAG_RESERVED) throw new BadFrame('REF frames are reserved');
  if (tag !== TAG_PLAIN) throw new BadFrame(`tag 0x${tag.toString(16)}`);
  if (frame.length <= HEADER_BYTES) throw new BadFrame(`frame of ${frame.length} bytes`);
  const distance = view.getUint16(5, true);
  if (distance === 0) throw new BadFrame('no distance from its base');
  return { isKey: false, baseId: view.getUint32(1, true), distance, ms: view.getUint16(7, true) };
}

/** The id by which later frames name this KEY: FNV-1a-32 of the whole message. */
export function frameId(frame: Uint8Array): number {
  return fnv1a32(frame);
}

/** FNV-1a, 32 bits (RFC 9923): names a schema by its text and a base by its bytes. */
export function fnv1a32(data: Uint8Array): number {
  let h = 0x811c9dc5;
  for (let i = 0; i < data.length; i++) h = Math.imul(h ^ data[i]!, 0x01000193);
  return h >>> 0;
}
