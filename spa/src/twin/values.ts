import { type Field, MISSING } from '@posecast/wire';

/** Reads one value, from a channel or computed from several, from a frame's codes; null: no reading. `atMs`: when the frame
 *  arrived, for values computed earlier; absent for the newest frame. */
export type ChannelReader = (codes: Int32Array, atMs?: number) => number | null;

/** The value of a field's `index`-th channel in the schema's unit; null: no reading, or no such channel. */
export function valueAt(codes: Int32Array, field: Field | null, index: number): number | null {
  if (field === null || index < 0 || index >= field.size) return null;
  const code = codes[field.start + index];
  return code === undefined || code === MISSING ? null : code * field.scale;
}
