/** What the page reads of strangers. Each says what it made of the bytes, or throws Refused. */

import {
  Decoder,
  decodeKeyPage,
  decodeRecording,
  decodeSegment,
  encodeKeyPage,
  encodeRecording,
  encodeSegment,
  FrameError,
  frameId,
  JointMapping,
  type KeyPage,
  keyPagePath,
  type Mapping,
  MISSING,
  mergeSegments,
  type PastRecording,
  parseRelayMessage,
  parseSchema,
  RecordingError,
  readBalance,
  type Schema,
  SchemaError,
  type Segment,
  SegmentError,
  type SegmentRecord,
  segmentPath,
  unpackSegment,
} from '@posecast/wire';
import { parentOrigin, readParentRequest } from '../../spa/src/app/pages/embed/parent.ts';
import { readShared, sharedQuery } from '../../spa/src/app/share/view_address.ts';
import { momentIn, parseRoute, queryOf, robotHref } from '../../spa/src/app/state/address.ts';
import { readSettings } from '../../spa/src/app/state/settings.ts';
import { BalanceReader } from '../../spa/src/model/balance/balance_reader.ts';
import { readMasses, readSoles } from '../../spa/src/model/balance/masses_and_soles.ts';
import { BundleError, parseManifest } from '../../spa/src/model/bundle.ts';
import { GlbError } from '../../spa/src/model/glb.ts';
import { Kinematics } from '../../spa/src/model/kinematics.ts';
import { readLod } from '../../spa/src/model/lod.ts';
import { boxesOfLinks, readManifest } from '../../spa/src/model/manifest.ts';
import { PastError } from '../../spa/src/past/past_source.ts';
import { DAY_MS } from '../../spa/src/past/past_types.ts';
import { openPosecastFile, PosecastFileError } from '../../spa/src/past/recording/posecast_file.ts';
import { readDay, readPage, readSummary } from '../../spa/src/past/relay/past_documents.ts';
import { PastIndex } from '../../spa/src/past/relay/past_index.ts';
import { chooseRelay, readConfig } from '../../spa/src/relay/config.ts';
import { readRawManifest } from '../../spa/src/scene/three/raw_bundle.ts';
import { MirrorReader } from '../../spa/src/stream/firebase_mirror.ts';
import { type LaneAnswer, readBeginning, readNext } from '../../spa/src/stream/lane/answers.ts';
import { Lane } from '../../spa/src/stream/lane/lane.ts';
import { readLaneAddress } from '../../spa/src/stream/lane/open_lane.ts';
import { frameBytes, SseParser } from '../../spa/src/stream/sse.ts';
import { DropError } from '../../spa/src/urdf/local_files.ts';
import { modelOf, UrdfError } from '../../spa/src/urdf/manifest.ts';
import { LodBuilder } from '../../spa/src/urdf/meshes/lod_builder.ts';
import { ownMesh } from '../../spa/src/urdf/meshes/primitives.ts';
import { MeshError, parseStl } from '../../spa/src/urdf/meshes/stl.ts';
import { weld } from '../../spa/src/urdf/meshes/weld.ts';
import { parseUrdf } from '../../spa/src/urdf/reader.ts';
import { readRobotText } from '../../spa/src/urdf/text.ts';
import { unzip } from '../../spa/src/urdf/unzip.ts';
import { XmlRefused } from '../../spa/src/urdf/xml.ts';

/** As its reader promises: one line that says why. */
export class Refused extends Error {}

type Reader = (bytes: Uint8Array) => unknown;
type ErrorClass = new (...args: never[]) => Error;

const VISUALS = 2; // of the levels that are read
const ENTRY_BYTES_MAX = 1 << 20;

export const TARGETS: ReadonlyMap<string, (bytes: Uint8Array) => Promise<unknown>> = new Map(
  Object.entries({
    schema: refusing([SchemaError], (bytes) => shownSchema(parseSchema(textOf(bytes)))),
    mapping: refusing([SchemaError], jointValues),
    frames: refusing([], decoded),
    segment: refusing([SegmentError], segment),
    'key-page': refusing([SegmentError], keyPage),
    recording: refusing([RecordingError], recording),
    'packed-segment': refusing([SegmentError], (bytes) => unpackSegment(bytes.slice()).then(digitsOf)),
    message: refusing([], (bytes) => parseRelayMessage(textOf(bytes))),
    manifest: refusing([BundleError], manifest),
    balance: refusing([BundleError], balance),
    glb: refusing([GlbError], (bytes) => readLod(bytes, VISUALS).then(() => null)),
    urdf: refusing([XmlRefused], (bytes) => parseUrdf(readRobotText(bytes))),
    body: refusing([XmlRefused, UrdfError], body),
    zip: refusing([DropError], members),
    'posecast-file': refusing([PosecastFileError], posecastFile),
    stl: refusing([MeshError], (bytes) => weld(parseStl(bytes).soup).index.length),
    address: refusing([], (bytes) => address(textOf(bytes))),
    embed: refusing([], (bytes) => embedded(textOf(bytes))),
    events: refusing([RangeError], events),
    mirror: refusing([RangeError], mirror),
    lane: refusing([], lane),
    past: refusing([PastError], (bytes) => past(jsonOf(textOf(bytes)))),
  } satisfies Record<string, Reader>),
);

function refusing(by: readonly ErrorClass[], read: Reader): (bytes: Uint8Array) => Promise<unknown> {
  return async (bytes) => {
    try {
      return await read(bytes);
    } catch (error) {
      const known = by.some((kind) => error instanceof kind);
      // A stack that is full is a RangeError as well, and nobody's promise.
      if (!known || (error instanceof RangeError && /call stack/.test(error.message))) throw error;
      throw new Refused((error as Error).message);
    }
  };
}

/** As a WebSocket hands it over. */
function textOf(bytes: Uint8Array): string {
  return new TextDecoder('utf-8', { ignoreBOM: true }).decode(bytes);
}

function jsonOf(text: string): unknown {
  try {
    return JSON.parse(text);
  } catch {
    return null;
  }
}

function shownSchema(schema: Schema): object {
  const { id, robot, fields, size, mapping } = schema;
  const { soles, ...rest } = readBalance(schema);
  const balance = { ...rest, soles: plain(soles) };
  return { id, robot, fields, size, mapping: { ...shownMapping(mapping), balance } };
}

/** Its parts are private to TypeScript, not to JavaScript. */
function shownMapping(mapping: Mapping): object {
  return Object.fromEntries(Object.entries(mapping).map(([part, entries]) => [part, plain(entries)]));
}

function plain(value: unknown): unknown {
  return value instanceof Map ? Object.fromEntries([...value].map(([k, v]) => [k, plain(v)])) : value;
}

/** A schema, a line end, and codes for its channels as 32-bit numbers: where the joints of the model stand. */
function jointValues(bytes: Uint8Array): unknown {
  const end = bytes.indexOf(0x0a) < 0 ? bytes.length : bytes.indexOf(0x0a);
  const schema = parseSchema(textOf(bytes.subarray(0, end)));
  readBalance(schema);
  const codes = codesIn(bytes.subarray(end + 1), schema.size);
  const found = ['pos', 'ref'].map((field) => {
    const joints = new JointMapping(schema, field);
    const values = joints.evaluate(codes);
    return [field, Object.fromEntries(joints.joints.map((joint, i) => [joint, values[i]]))];
  });
  return Object.fromEntries(found);
}

function codesIn(bytes: Uint8Array, size: number): Int32Array {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  return Int32Array.from({ length: size }, (_, i) =>
    4 * i + 4 <= bytes.length ? view.getInt32(4 * i, true) >> 3 : 0,
  );
}

/** A schema, a line end, and frames, each after its length in two bytes: what a decoder says of each. */
function decoded(bytes: Uint8Array): unknown {
  const end = bytes.indexOf(0x0a) < 0 ? bytes.length : bytes.indexOf(0x0a);
  const decoder = new Decoder();
  const said: unknown[] = [];
  try {
    decoder.addSchema(textOf(bytes.subarray(0, end)));
  } catch (error) {
    if (!(error instanceof SchemaError)) throw error;
    return said;
  }
  for (let at = end + 1; at + 2 <= bytes.length; ) {
    const size = bytes[at]! | (bytes[at + 1]! << 8);
    const frame = bytes.subarray(at + 2, at + 2 + size);
    at += 2 + size;
    try {
      const { seq, tS, codes } = decoder.decode(frame);
      said.push([seq, tS, [...codes], frameId(frame)]);
    } catch (error) {
      if (!(error instanceof FrameError)) throw error;
      said.push(error.name);
    }
  }
  return said;
}

/** As `wire/python/tools/make_segment_vectors.py` shows it. What is read can be written, and is then the same. */
function segment(bytes: Uint8Array): unknown {
  const found = shownSegment(decodeSegment(bytes));
  const again = shownSegment(decodeSegment(encodeSegment(decodeSegment(bytes))));
  if (JSON.stringify(found) !== JSON.stringify(again)) throw new Error('written it is another');
  const merged = mergeSegments([decodeSegment(bytes), decodeSegment(bytes)]).frames;
  const { records } = decodeSegment(bytes);
  if (merged.length !== records.filter(({ kind }) => kind === 'frame').length)
    throw new Error('merged with itself it is another');
  return found;
}

/** As `wire/python/tools/make_key_page_vectors.py` shows it. What is read can be written, and is then the same. */
function keyPage(bytes: Uint8Array): unknown {
  const page = decodeKeyPage(bytes);
  const found = shownKeyPage(page);
  const again = shownKeyPage(decodeKeyPage(encodeKeyPage(page, page.poses)));
  if (JSON.stringify(found) !== JSON.stringify(again)) throw new Error('written it is another');
  return found;
}

/** As `wire/python/tools/make_recording_vectors.py` shows it. What is read can be written, and is then the same. */
function recording(bytes: Uint8Array): unknown {
  const said = decodeRecording(bytes);
  const found = shownRecording(said);
  const again = shownRecording(decodeRecording(encodeRecording(said)));
  if (JSON.stringify(found) !== JSON.stringify(again)) throw new Error('written it is another');
  return found;
}

function shownRecording({ fromMs, toMs, notes, schemas, segments, ...rest }: PastRecording): object {
  const shown = segments.map((one) => {
    const { runId, firstSeq, lastSeq, words, events, fromMs: beginsMs, toMs: endsMs, ...others } = one;
    const named = { run_id: runId, from_ms: beginsMs, to_ms: endsMs, first_seq: firstSeq, last_seq: lastSeq };
    return {
      ...others,
      ...named,
      path: segmentPath(one),
      key_page: keyPagePath(beginsMs),
      words: words.map(({ atMs, word }) => [atMs, word]),
      events: events.map(({ atMs, event }) => [atMs, event]),
    };
  });
  const noted = notes.map(({ atMs, text }) => [atMs, text]);
  return { ...rest, from_ms: fromMs, to_ms: toMs, notes: noted, schemas: [...schemas], segments: shown };
}

function shownKeyPage({ robot, view, fromMs, poses }: KeyPage): object {
  const shown = poses.map(({ atMs, runId, lateUs, copies, frame, ...rest }) => {
    const named = { at_ms: atMs, run_id: runId, late_us: lateUs };
    return { ...rest, ...named, copies: copies.map(digitsOf), frame: digitsOf(frame) };
  });
  return { robot, view, from_ms: fromMs, poses: shown };
}

function digitsOf(bytes: Uint8Array): string {
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, '0')).join('');
}

function shownSegment({ start, toMs, records }: Segment): object {
  const { runId, fromMs, eventN, openFaults, info, ...rest } = start;
  const named = { ...rest, run_id: runId, from_ms: fromMs, event_n: eventN, open_faults: openFaults };
  return { start: { ...named, info: [...info] }, to_ms: toMs, records: records.map(shownRecord) };
}

function shownRecord(record: SegmentRecord): unknown[] {
  const { kind, atUs, ...rest } = record;
  const said = Object.values(rest).map((value: unknown) =>
    value instanceof Uint8Array ? digitsOf(value) : value instanceof Map ? [...value] : value,
  );
  return [kind, atUs, ...said];
}

function manifest(bytes: Uint8Array): unknown {
  const raw = parseManifest(new TextDecoder().decode(bytes));
  if (raw.v !== 2) return readRawManifest(raw).files.size;
  const found = readManifest(raw);
  new Kinematics(found.joints);
  readMasses(found);
  readSoles(found);
  return boxesOfLinks(found).size;
}

const SITES = { RF: 'right_foot', LF: 'left_foot' };
const labelsOf = (of: string) =>
  Object.keys(SITES).flatMap((site) => ['x', 'y', 'z'].map((axis) => `${site}.${of}${axis}`));
const STANDING = parseSchema(
  JSON.stringify({
    ...{ type: 'schema', v: 1, robot: 'standing' },
    labels: { joint: ['right_leg', 'left_leg'], ftf: labelsOf('f'), ftm: labelsOf('m') },
    fields: [
      { name: 'pos', labels: 'joint', scale: 0.001 },
      { name: 'ftf', labels: 'ftf' },
      { name: 'ftm', labels: 'ftm', scale: 0.1 },
    ],
    mapping: {
      sensors: Object.fromEntries(
        Object.entries(SITES).map(([site, link]) => [site, { kind: 'wrench', name: site, link }]),
      ),
    },
  }),
);

/** Whatever masses and soles a model has, each number of its balance is finite, or there is none. */
function balance(bytes: Uint8Array): void {
  const reader = new BalanceReader(readManifest(parseManifest(new TextDecoder().decode(bytes))), STANDING);
  for (const [tS, code] of [
    [0, 900],
    [0.1, -700],
    [0.2, MISSING],
  ] as const) {
    const found = reader.ofFrame(new Int32Array(STANDING.size).fill(code), tS);
    const points = [found.centreOfMass, found.velocity, found.capturePoint, found.pressure, ...found.polygon];
    const numbers = [...points.flatMap((point) => point ?? []), found.floorM ?? 0, found.marginM ?? 0];
    if (!numbers.every(Number.isFinite)) throw new Error('a number that is not finite');
  }
}

/** What the page draws of a URDF whose meshes it has not: a manifest as a builder could have written it, and its own shapes. */
function body(bytes: Uint8Array): unknown {
  const { manifest: found, shapes } = modelOf(parseUrdf(readRobotText(bytes)));
  const joints = found.joints.map((joint, i) => ({
    ...joint,
    child: i + 1,
    mimic: joint.mimic ?? undefined,
  }));
  const visuals = found.visuals.slice(0, 1024).map(({ link, source }) => ({ link, source }));
  readManifest({ ...found, joints, visuals });
  readMasses(found);
  new Kinematics(found.joints);
  const lod = new LodBuilder(shapes);
  for (const [i, placed] of [...shapes.slice(0, 8).entries(), ...[...shapes.entries()].slice(8).slice(-4)]) {
    if (placed.shape.kind === 'mesh') continue;
    try {
      lod.put(i, ownMesh(placed));
    } catch (error) {
      if (!(error instanceof MeshError)) throw error;
    }
  }
  return lod.build().index.length;
}

/** Every entry of a `.posecast` file is read: what it gives has as many bytes as it says. */
async function posecastFile(bytes: Uint8Array): Promise<object> {
  const file = await openPosecastFile(new Blob([bytes as Uint8Array<ArrayBuffer>]));
  const sizes: Record<string, number | string> = {};
  for (const name of file.names)
    sizes[name] = await file.read(name, ENTRY_BYTES_MAX).then(
      (entry) => entry.length,
      (error: unknown) => {
        if (!(error instanceof PastError)) throw error;
        return error.why;
      },
    );
  return sizes;
}

async function members(bytes: Uint8Array): Promise<unknown> {
  const found = await unzip(new Blob([bytes.slice()]));
  const unpacked = [...found].filter(([, { size }]) => size > 0); // the others are known by name
  return Promise.all(unpacked.map(async ([path, file]) => [path, (await file.bytes()).length]));
}

const PAGE_AT_MS = Date.UTC(2026, 10, 22, 14, 20);

/** What the routes of the past answer, each read as each, into a time line. */
function past(json: unknown): unknown {
  const index = new PastIndex();
  const refused: PastError[] = [];
  for (const read of [
    () => index.setSummary(readSummary(json)),
    () => index.setDay(dayBefore(PAGE_AT_MS), readDay(json, dayBefore(PAGE_AT_MS)), PAGE_AT_MS),
    () => index.addPage(PAGE_AT_MS, readPage(json, PAGE_AT_MS), 0, PAGE_AT_MS),
  ]) {
    try {
      read();
    } catch (error) {
      if (!(error instanceof PastError)) throw error;
      refused.push(error);
    }
  }
  const { timeline } = index;
  if (refused.length === 3) throw refused[0];
  return [timeline?.movement.length, timeline?.words.length, timeline?.marks.length];
}

/** The address of a lane, a line end, and what its relay answers, to each question the same. */
function lane(bytes: Uint8Array): unknown {
  const end = bytes.indexOf(0x0a) < 0 ? bytes.length : bytes.indexOf(0x0a);
  const robot = 'https://relay/api/v1/robots/demo/';
  const address = readLaneAddress(textOf(bytes.subarray(0, end)), 'wss://relay/api/v1/robots/demo/live');
  if (address !== null && address.pastUrl !== `${robot}past`) throw new Error(`a lane at ${address.pastUrl}`);
  const body = bytes.subarray(end + 1);
  const answers = [true, false].map((isJson): LaneAnswer => {
    return { status: 200, isJson, retryMs: null, dateMs: null, bytes: body };
  });
  const before = { frame: null, event: null, faults: [] };
  const read = new Lane({
    robot: 'demo',
    view: address?.view ?? null,
    hz: 30,
    isVisible: true,
    before,
    random: () => 0.5,
  });
  const did = read.start(0).map((action) => action.do);
  for (let i = 1; i < 9; i++)
    for (const action of read.answered(1000 * i, answers[i % 2]!)) did.push(action.do);
  return [address?.view, readBeginning(answers[0]!), readNext(answers[0]!), did];
}

function dayBefore(atMs: number): number {
  return Math.floor(atMs / DAY_MS) * DAY_MS;
}

/** All that the page reads out of its own address. What it writes back must read the same. */
function address(text: string): unknown {
  const [search = '', hash = ''] = text.split('#', 2);
  const route = parseRoute(`#${hash}`);
  if (
    route.page === 'robots' &&
    JSON.stringify(parseRoute(robotHref(...route.robots))) !== JSON.stringify(route)
  )
    throw new Error('a link to these robots leads elsewhere');
  const query = queryOf(`#${hash}`);
  const momentMs = momentIn(`#${hash}`);
  const shared = { ...readShared(query), momentMs };
  const written = `#/${sharedQuery(readSettings(null), shared)}`;
  const again = readShared(queryOf(written));
  if (momentIn(written) !== momentMs) throw new Error('a link to this moment names another');
  if (again.joint !== shared.joint) throw new Error('a link to this joint names another');
  readSettings(JSON.stringify(Object.fromEntries(query)));
  chooseRelay('https://here.example/page/', search, readConfig(jsonOf(search)));
  return parentOrigin(search);
}

function embedded(text: string): unknown {
  readConfig(jsonOf(text));
  readSettings(text);
  return readParentRequest(jsonOf(text));
}

function events(bytes: Uint8Array): unknown {
  const reader = new SseParser();
  const half = bytes.length >> 1;
  const found = [...reader.read(bytes.subarray(0, half)), ...reader.read(bytes.subarray(half))];
  const whole = new SseParser().read(bytes);
  if (JSON.stringify(found) !== JSON.stringify(whole)) throw new Error('in two pieces it reads otherwise');
  return found.map(({ name, data }) => (name === 'frame' ? frameBytes(data) : parseRelayMessage(data)));
}

/** What a database streams of a robot, read a tenth of a second apart. */
function mirror(bytes: Uint8Array): unknown {
  const reader = new MirrorReader(1);
  return new SseParser().read(bytes).map((event, i) => {
    reader.tick(100 * i);
    return reader.read(100 * i, event);
  });
}
