/** Reads segments and pages of KEYs: a separate chunk, needed only for looking back. */
export { decodeKeyPage, decodeSegment, SegmentError } from '@posecast/wire';
