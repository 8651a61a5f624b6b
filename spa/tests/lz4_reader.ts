const PLAIN = 0x8000_0000;

/** The bytes of an LZ4 frame with independent blocks and without checksums. Written from the format's specification. */
export function readLz4Frame(frame: Uint8Array): Uint8Array {
  const view = new DataView(frame.buffer, frame.byteOffset, frame.byteLength);
  if (view.getUint32(0, true) !== 0x184d2204 || frame[4] !== 0x60) throw new Error('another kind of frame');
  const blocks: Uint8Array[] = [];
  let at = 7;
  for (let size = view.getUint32(at, true); size !== 0; size = view.getUint32(at, true)) {
    const count = size % PLAIN;
    const block = frame.subarray(at + 4, at + 4 + count);
    blocks.push(size >= PLAIN ? block : readBlock(block));
    at += 4 + count;
  }
  if (at + 4 !== frame.length) throw new Error('more behind the end');
  return Uint8Array.from(Buffer.concat(blocks));
}

function readBlock(block: Uint8Array): Uint8Array {
  const out: number[] = [];
  let at = 0;
  const lengthOf = (part: number) => {
    let length = part;
    for (let more = 255; part === 15 && more === 255; length += more) more = block[at++]!;
    return length;
  };
  let matched = -1; // latest start of the last match
  while (at < block.length) {
    const token = block[at++]!;
    const literals = lengthOf(token >> 4);
    for (let left = literals; left > 0; left--) out.push(block[at++]!);
    if (at === block.length) {
      // the last one has no match
      if (matched >= 0 && (literals < 5 || matched > out.length - 12))
        throw new Error('a match near the end');
      break;
    }
    matched = out.length;
    const offset = block[at]! + 256 * block[at + 1]!;
    at += 2;
    if (offset === 0 || offset > out.length) throw new Error('a match before the beginning');
    for (let left = lengthOf(token & 15) + 4; left > 0; left--) out.push(out[out.length - offset]!);
  }
  return Uint8Array.from(out);
}
