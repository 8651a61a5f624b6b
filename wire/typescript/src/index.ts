/** Posecast wire format 1: schema, frames, messages, segments. `wire/SPEC.md` is the normative text. */

export { SchemaError } from './checked.ts';
export { Close, ENDINGS, type Ending, type Retry, retryOf } from './closes.ts';
export { Decoder, Frame } from './decoder.ts';
export { Encoder } from './encoder.ts';
export {
  BadFrame,
  BaseUnknown,
  FrameError,
  fnv1a32,
  frameId,
  type Header,
  parseHeader,
  TAG_KEY,
  WIRE_VERSION,
} from './frame.ts';
export {
  type Bye,
  type EventLevel,
  type EventMessage,
  type Hello,
  type Info,
  type ModelMessage,
  type Pong,
  parseRelayMessage,
  type RateGranted,
  type RelayMessage,
  type RobotStatus,
  type SchemaMessage,
  type Status,
  type ViewerMessage,
} from './messages.ts';
export { unpackSegment } from './recording/packed.ts';
export { decodeRecording, eventOf } from './recording/reader.ts';
export {
  checkSegment,
  keyPagePath,
  modelPath,
  type PastRecording,
  RECORDING_FILE,
  type RecordedEvent,
  type RecordedSegment,
  type RecordedWord,
  RecordingError,
  type RecordingNote,
  segmentPath,
} from './recording/recording.ts';
export { encodeRecording } from './recording/writer.ts';
export {
  CODE_MAX,
  Field,
  JOINT,
  type JointMap,
  JointMapping,
  type Level,
  level,
  type Mapping,
  MISSING,
  revived,
  Schema,
  type SensorKind,
  type SensorMount,
  type Sentence,
  type Severity,
  type Threshold,
} from './schema.ts';
export { parseSchema } from './schema_parser.ts';
export { decodeKeyPage, type KeyPage, type KeyPose } from './segment/key_page.ts';
export { encodeKeyPage, pickPose } from './segment/key_page_writer.ts';
export { type FrameGap, type MergedFrame, mergeSegments } from './segment/merge.ts';
export { decodeSegment } from './segment/reader.ts';
export {
  type Segment,
  SegmentError,
  type SegmentRecord,
  type SegmentStart,
} from './segment/segment.ts';
export { encodeSegment } from './segment/writer.ts';
export { type BalanceRule, type Ground, readBalance } from './stance.ts';
export { RIGHT_TO_LEFT, visible } from './visible.ts';
