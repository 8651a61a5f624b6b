import { McapWriter } from '@mcap/core';
import type { Schema } from '@posecast/wire';
import { BlobParts } from './blob_parts.ts';
import { lz4Frame } from './lz4_frame.ts';
import { CdrWriter } from './ros/cdr_writer.ts';
import { DEFINITIONS, type MessageType } from './ros/definitions.ts';
import { type FrameTopic, NO_UNITS, valuesOf } from './ros/frame_topic.ts';
import { LinkFrames } from './ros/link_frames.ts';
import { topicsOf, writeLog } from './ros/topics.ts';
import type { SavePorts } from './save_ports.ts';
import { eventsOf, framesOf, type SavedFrame } from './saved_frames.ts';
import { loadManifests, ModelTimeline } from './saved_models.ts';
import type { SavedSpan } from './saved_span.ts';

const CHUNK_BYTES = 1 << 20;
const LIBRARY = 'posecast';

/** Writes the frames and events as ROS 2 messages. At most one chunk and one part of the file are held in memory. `lostModels`:
 *  how many models were unavailable, so that their links are missing. */
export async function writeMcap(
  span: SavedSpan,
  ports: Pick<SavePorts, 'models' | 'breathe' | 'signal'>,
  onPart: (part: number) => void,
): Promise<{ readonly blob: Blob; readonly lostModels: number }> {
  const file = new BlobParts();
  const messages = new MessageWriter(file);
  const manifests = await loadManifests(span, ports);
  const bodies = new Map([...manifests].map(([model, found]) => [model, found && new LinkFrames(found)]));
  await messages.begin();
  const events = eventsOf(span);
  const models = new ModelTimeline(span);
  for (const frame of framesOf(span, onPart)) {
    while (events.length > 0 && events[0]!.atUs <= frame.atUs) await messages.event(events.shift()!);
    await messages.frame(frame, bodies.get(models.at(frame.atUs) ?? '') ?? null);
    await ports.breathe();
    ports.signal.throwIfAborted();
  }
  for (const event of events) await messages.event(event);
  await messages.end();
  const lostModels = [...bodies.values()].filter((body) => body === null).length;
  return { blob: file.blob('application/octet-stream'), lostModels };
}

/** Writes messages into an MCAP file, and opens a channel for each topic at its first message. */
class MessageWriter {
  readonly #writer: McapWriter;
  readonly #cdr = new CdrWriter();
  readonly #schemas = new Map<MessageType, number>();
  readonly #channels = new Map<string, { readonly id: number; count: number }>();
  /** The last one written. */
  #told: {
    readonly schema: Schema;
    readonly rootLink: string | null;
    readonly topics: readonly FrameTopic[];
    readonly values: Float64Array;
  } | null = null;

  constructor(file: BlobParts) {
    const writable = {
      write: async (bytes: Uint8Array) => file.write(bytes),
      position: () => BigInt(file.size),
    };
    const compressChunk = (chunk: Uint8Array) => ({ compression: 'lz4', compressedData: lz4Frame(chunk) });
    this.#writer = new McapWriter({ writable, chunkSize: CHUNK_BYTES, compressChunk });
  }

  begin(): Promise<void> {
    return this.#writer.start({ profile: 'ros2', library: LIBRARY });
  }

  end(): Promise<void> {
    return this.#writer.end();
  }

  async frame({ schema, atUs, codes }: SavedFrame, body: LinkFrames | null): Promise<void> {
    if (body !== null) {
      body.write(this.#cdr, atUs, schema, codes);
      await this.#add('/tf', 'tf2_msgs/msg/TFMessage', atUs);
    }
    const { topics, values } = this.#topicsOf(schema, body?.rootLink ?? null);
    valuesOf(schema, codes, values);
    for (const topic of topics) {
      topic.write(this.#cdr, atUs, values);
      await this.#add(topic.name, topic.type, atUs, topic.units);
    }
  }

  async event({ atUs, event }: ReturnType<typeof eventsOf>[number]): Promise<void> {
    writeLog(this.#cdr, atUs, event);
    await this.#add('/rosout', 'rcl_interfaces/msg/Log', atUs);
  }

  #topicsOf(schema: Schema, rootLink: string | null) {
    const told = this.#told;
    if (told?.schema === schema && told.rootLink === rootLink) return told;
    const values = new Float64Array(schema.size);
    this.#told = { schema, rootLink, topics: topicsOf(schema, rootLink), values };
    return this.#told;
  }

  /** Adds the content of the CDR writer. */
  async #add(topic: string, type: MessageType, atUs: number, units = NO_UNITS): Promise<void> {
    const key = JSON.stringify([topic, ...units]);
    const channel = this.#channels.get(key) ?? (await this.#open(topic, type, units));
    this.#channels.set(key, channel);
    const logTime = BigInt(atUs) * 1000n;
    await this.#writer.addMessage({
      channelId: channel.id,
      sequence: ++channel.count,
      logTime,
      publishTime: logTime,
      data: this.#cdr.bytes,
    });
  }

  async #open(topic: string, type: MessageType, units: ReadonlyMap<string, string>) {
    const schemaId = this.#schemas.get(type) ?? (await this.#define(type));
    this.#schemas.set(type, schemaId);
    const id = await this.#writer.registerChannel({
      topic,
      schemaId,
      messageEncoding: 'cdr',
      metadata: new Map(units),
    });
    return { id, count: 0 };
  }

  #define(type: MessageType): Promise<number> {
    const data = new TextEncoder().encode(DEFINITIONS[type]);
    return this.#writer.registerSchema({ name: type, encoding: 'ros2msg', data });
  }
}
