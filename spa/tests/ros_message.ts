/** Reads ROS 2 messages as CDR using only their definitions (`ros2msg`), as an independent program would. */

type Member = { readonly name: string; readonly type: string; readonly count: number | 'any' | null };
export type RosValue = number | string | null | readonly RosValue[] | { readonly [name: string]: RosValue };

const SIZES: Readonly<Record<string, number>> = { uint8: 1, byte: 1, int32: 4, uint32: 4, float64: 8 };

/** The content of a message; NaN is null. */
export function readRosMessage(definition: string, data: Uint8Array): RosValue {
  const [own, ...parts] = definition.split(`${'='.repeat(80)}\n`);
  const types = new Map(
    parts.map((part) => {
      const [head, ...lines] = part.split('\n');
      return [head!.replace('MSG: ', ''), membersOf(lines)] as const;
    }),
  );
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  if (view.getUint32(0) !== 0x0001_0000) throw new Error('not plain CDR, little endian');
  let at = 4;
  const align = (size: number) => {
    at += (size - ((at - 4) % size)) % size;
  };
  const scalar = (type: string): RosValue => {
    const size = SIZES[type] ?? 4;
    align(size);
    at += size;
    if (type === 'float64') {
      const value = view.getFloat64(at - 8, true);
      return Number.isNaN(value) ? null : value;
    }
    if (type === 'int32') return view.getInt32(at - 4, true);
    return size === 1 ? view.getUint8(at - 1) : view.getUint32(at - 4, true);
  };
  const one = (type: string): RosValue => {
    if (type in SIZES) return scalar(type);
    if (type === 'string') {
      const length = scalar('uint32') as number;
      at += length;
      if (data[at - 1] !== 0) throw new Error('a text without its zero');
      return new TextDecoder('utf-8', { fatal: true }).decode(data.subarray(at - length, at - 1));
    }
    const members = types.get(type);
    if (members === undefined) throw new Error(`no definition of ${type}`);
    return all(members);
  };
  const all = (members: readonly Member[]): RosValue =>
    Object.fromEntries(
      members.map(({ name, type, count }) => {
        if (count === null) return [name, one(type)];
        const length = count === 'any' ? (scalar('uint32') as number) : count;
        return [name, Array.from({ length }, () => one(type))];
      }),
    );
  const value = all(membersOf(own!.split('\n')));
  if (at !== data.length) throw new Error(`${data.length - at} bytes are left`);
  return value;
}

function membersOf(lines: readonly string[]): Member[] {
  return lines
    .filter((line) => line !== '' && !line.includes('='))
    .map((line) => {
      const [, type, count, name] = /^([\w/]+)(?:\[(\d*)\])? (\w+)/.exec(line)!;
      return {
        name: name!,
        type: type!,
        count: count === undefined ? null : count === '' ? 'any' : Number(count),
      };
    });
}
