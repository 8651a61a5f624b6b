import { decodeSegment, type RobotStatus, type Segment, SegmentError } from '@posecast/wire';

/** What the robot was at the end of a part. */
export function lastWordOf({ start, records }: Segment): RobotStatus {
  const last = records.findLast((record) => record.kind === 'word');
  return last?.kind === 'word' ? last.word : start.word;
}

/** The segment that came; null if it is none. */
export function decoded(bytes: Uint8Array): Segment | null {
  try {
    return decodeSegment(bytes);
  } catch (error) {
    if (error instanceof SegmentError) return null;
    throw error;
  }
}
