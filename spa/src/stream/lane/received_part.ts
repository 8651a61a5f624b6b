import { decodeSegment, type RobotStatus, type Segment, SegmentError } from '@posecast/wire';
import type { PartName } from './answers.ts';

/** Which part was requested. */
export interface WantedPart extends PartName {
  readonly robot: string;
  readonly view: string | null;
}

/** The requested part; null if these bytes are not a part, or another one: a cache may have mixed them up. */
export function readPart(bytes: Uint8Array, { robot, view, take, index }: WantedPart): Segment | null {
  try {
    const segment = decodeSegment(bytes);
    const { start } = segment;
    const isSame =
      start.robot === robot && start.view === view && start.take === take && start.index === index;
    return isSame ? segment : null;
  } catch (error) {
    if (error instanceof SegmentError) return null;
    throw error;
  }
}

/** The robot's state at the end of a part. */
export function lastWordOf({ start, records }: Segment): RobotStatus {
  const last = records.findLast((record) => record.kind === 'word');
  return last?.kind === 'word' ? last.word : start.word;
}
