import type { Schema } from '@posecast/wire';

/** The fields that define a pose: while none of them changes, the robot is holding still. */
const POSE_FIELDS = ['pos', 'ref', 'flags'] as const;

/** Whether two frames' codes show different poses. Codes are compared exactly: a robot at rest keeps sending the same
 *  codes. */
export function poseDiffers(schema: Schema, before: Int32Array, after: Int32Array): boolean {
  let any = false;
  for (const name of POSE_FIELDS) {
    const field = schema.field(name);
    if (field === null) continue;
    any = true;
    for (let i = field.start; i < field.start + field.size; i++) if (before[i] !== after[i]) return true;
  }
  if (any) return false;
  return before.some((code, i) => code !== after[i]); // a robot without joints: everything counts
}
