import { type Field, MISSING } from '@posecast/wire';

/** A channel, or what is computed from some, in one frame's codes; null is no reading. */
export type ChannelReader = (codes: Int32Array) => number | null;

/** The value of the field's `index`-th channel in the schema's unit; null is "no reading". */
export function valueAt(codes: Int32Array, field: Field | null, index: number): number | null {
  if (field === null || index < 0 || index >= field.size) return null;
  const code = codes[field.start + index];
  return code === undefined || code === MISSING ? null : code * field.scale;
}
