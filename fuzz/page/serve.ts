/** Reads cases from stdin, answers on stdout, one after the other: what `page_reader.py` talks to. */

import { readSync, writeSync } from 'node:fs';
import { Refused, TARGETS } from './targets.ts';
import { installDomParser } from './xml_by_expat.ts';

/** Written by the counters that build.mjs weaves in. */
declare const __hits: Uint8Array;

const STDIN = 0;
const STDOUT = 1;
const RESULT = 'R'.charCodeAt(0);
const XML = 'X'.charCodeAt(0);

/** Exactly so many bytes; null where the input ends. */
function take(size: number): Buffer | null {
  const bytes = Buffer.alloc(size);
  for (let at = 0; at < size; ) {
    const read = readSync(STDIN, bytes, at, size - at, null);
    if (read === 0) return null;
    at += read;
  }
  return bytes;
}

function takeMessage(): Buffer | null {
  const size = take(4);
  return size && take(size.readUInt32LE());
}

function send(...parts: readonly Uint8Array[]): void {
  const whole = Buffer.concat([new Uint8Array(4), ...parts]);
  whole.writeUInt32LE(whole.length - 4);
  for (let at = 0; at < whole.length; ) at += writeSync(STDOUT, whole, at);
}

/** NaN and the infinities, which JSON lacks, as what no reader gives otherwise. */
function odd(_: string, value: unknown): unknown {
  if (typeof value === 'number' && !Number.isFinite(value)) return { odd: String(value) };
  if (value instanceof Map) return Object.fromEntries(value);
  return ArrayBuffer.isView(value) ? Array.from(value as Int32Array) : value;
}

/** What is thrown where nobody waits for it. */
let unhandled: unknown = null;
const keep = (error: unknown) => {
  unhandled ??= error;
};

/** The numbers of the counters that were hit since the last call, two bytes each. */
function hits(): Uint8Array {
  const found: number[] = [];
  for (let i = __hits.indexOf(1); i >= 0; i = __hits.indexOf(1, i + 1)) {
    found.push(i);
    __hits[i] = 0;
  }
  return new Uint8Array(Uint16Array.from(found).buffer);
}

function storyOf(error: unknown): string {
  return error instanceof Error ? (error.stack ?? String(error)) : String(error);
}

async function answer(message: Buffer): Promise<void> {
  const at = 1 + message[0]!;
  const read = TARGETS.get(message.toString('latin1', 1, at));
  if (read === undefined) throw new Error('no such target');
  const payload = Uint8Array.from(message.subarray(at));
  hits();
  const before = process.resourceUsage();
  let said: object;
  try {
    said = { value: await read(payload) };
  } catch (error) {
    said = error instanceof Refused ? { refused: error.message } : { fault: storyOf(error) };
  }
  await new Promise(setImmediate); // what nobody waits for comes by now
  if (unhandled !== null) said = { fault: storyOf(unhandled) };
  unhandled = null;
  const after = process.resourceUsage();
  const head = Buffer.alloc(11);
  const ways = hits();
  head[0] = RESULT;
  head.writeUInt32LE(after.userCPUTime + after.systemCPUTime - before.userCPUTime - before.systemCPUTime, 1);
  head.writeUInt32LE(after.maxRSS - before.maxRSS, 5);
  head.writeUInt16LE(ways.length / 2, 9);
  send(head, ways, Buffer.from(JSON.stringify(said, odd)));
}

process.on('unhandledRejection', keep);
process.on('uncaughtException', keep);
console.log = console.error; // stdout is for answers
installDomParser((text) => {
  send(Uint8Array.of(XML), Buffer.from(text));
  return takeMessage()?.toString() ?? 'null';
});
await TARGETS.get('glb')?.(new Uint8Array()).catch(() => {}); // its decoder is compiled beforehand
send(Buffer.from('ready'));
for (let message = takeMessage(); message !== null; message = takeMessage()) await answer(message);
