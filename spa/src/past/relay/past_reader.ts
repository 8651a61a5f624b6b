/** What segments and pages of KEYs are read with: a part of its own, which nobody needs who does not look back. */
export { decodeKeyPage, decodeSegment, SegmentError } from '@posecast/wire';
