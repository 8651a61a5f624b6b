/** Writes whole segments, with the same bytes as Python. */

import { ByteWriter, hashOf, utf8Of } from './byte_writer.ts';
import { packEnvelope } from './envelope.ts';
import { FrameChain } from './frame_chain.ts';
import {
  DURATION_MS_MAX,
  EVENT_BYTES_MAX,
  FROM_MS_MAX,
  INFO_BYTES_MAX,
  KINDS,
  NAME,
  NAME_BYTES_MAX,
  NUMBERING_BYTES_MAX,
  OPEN_FAULTS_MAX,
  RECORDS_BYTES_MAX,
  refuse,
  SEGMENT,
  type Segment,
  type SegmentRecord,
  U32_MAX,
  WORDS,
} from './segment.ts';

/** The bytes of a segment. SegmentError when they could not be read again. */
export function encodeSegment(segment: Segment): Uint8Array {
  const chain = new FrameChain();
  const durationMs = segment.toMs - segment.start.fromMs;
  const records = packRecords(segment.records, durationMs, chain);
  const header = packHeader(segment, durationMs, chain);
  return packEnvelope(SEGMENT, header, records, segment.records.length);
}

function packHeader({ start }: Segment, durationMs: number, chain: FrameChain): Uint8Array {
  if (!NAME.test(start.robot) || !NAME.test(start.view)) refuse('header', 'robot or view: no name');
  if (start.openFaults.length > OPEN_FAULTS_MAX)
    refuse('open faults', `${start.openFaults.length}, ${OPEN_FAULTS_MAX} allowed`);
  if (chain.count > 0 && (start.schema === null || /^0+$/.test(start.runId)))
    refuse('header', 'frames without a schema or run');
  if (chain.copies > 0 && chain.count === 0) refuse('records', 'copies without frames');
  const to = new ByteWriter();
  to.text('robot', start.robot, NAME_BYTES_MAX);
  to.text('view', start.view, NAME_BYTES_MAX);
  to.u64('take', start.take);
  to.varint('index', start.index, U32_MAX);
  to.u64('run', start.runId);
  to.varint('from', start.fromMs, FROM_MS_MAX);
  to.varint('duration', durationMs, DURATION_MS_MAX);
  to.varint('frames', chain.count);
  to.varint('first seq', chain.firstSeq);
  to.varint('last seq', chain.lastSeq);
  to.hash('schema', start.schema);
  to.hash('model', start.model);
  to.byte(WORDS.indexOf(start.word));
  to.varint('missing', start.missing, U32_MAX);
  to.text('numbering', start.numbering, NUMBERING_BYTES_MAX);
  to.varint('event n', start.eventN);
  to.info('info', start.info, INFO_BYTES_MAX);
  to.varint('open faults', start.openFaults.length);
  for (const text of start.openFaults) to.text('open fault', text, EVENT_BYTES_MAX);
  return to.data;
}

function packRecords(records: readonly SegmentRecord[], durationMs: number, chain: FrameChain): Uint8Array {
  const all = new ByteWriter();
  let beforeUs = 0;
  for (const record of records) {
    const { atUs } = record;
    if (!(atUs >= beforeUs && atUs <= durationMs * 1000 + 999))
      refuse('record', `at ${atUs} µs of ${durationMs} ms, the one before at ${beforeUs} µs`);
    const content = packRecord(record, chain);
    all.byte(KINDS.indexOf(record.kind));
    all.varint('wait', atUs - beforeUs);
    all.varint('length', content.length);
    all.bytes(content);
    beforeUs = atUs;
    if (all.length > RECORDS_BYTES_MAX)
      refuse('records', `${all.length} bytes, ${RECORDS_BYTES_MAX} allowed`);
  }
  return all.data;
}

function packRecord(record: SegmentRecord, chain: FrameChain): Uint8Array {
  const content = new ByteWriter();
  switch (record.kind) {
    case 'frame': {
      const seq = chain.addFrame(record.frame);
      if (seq !== record.seq) refuse('frame', `its number is ${seq}, not ${record.seq}`);
      content.varint('lateness', record.lateUs);
      content.bytes(record.frame);
      break;
    }
    case 'copy':
      chain.addCopy(record.frame);
      content.bytes(record.frame);
      break;
    case 'event':
      content.bytes(utf8Of('event', record.text, EVENT_BYTES_MAX));
      break;
    case 'info':
      content.info('info', record.info, INFO_BYTES_MAX);
      break;
    case 'model':
      content.bytes(hashOf('model', record.model));
      break;
    case 'word':
      content.byte(WORDS.indexOf(record.word));
      break;
  }
  return content.data;
}
