import { Emitter, perObject } from '../../kit.ts';
import { type Crossing, LimitLog } from '../../twin/alarms/limit_log.ts';
import type { Threshold } from '../../twin/limits.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { SensorTable } from '../../twin/sensors/sensors.ts';

/** The crossings of limits that this page alone watches, for each robot. */
const ownOf = perObject((_: RobotTwin) => ({
  log: new LimitLog(),
  changed: new Emitter(),
  isWatched: false,
}));

/** Checks the viewer's own limits in every frame from now on. A second call for the same robot does nothing. */
export function watchOwnLimits(twin: RobotTwin): void {
  const own = ownOf(twin);
  if (own.isWatched) return;
  own.isWatched = true;
  let table: { schema: RobotTwin['schema']; of: SensorTable } | null = null;
  twin.onState(() => {
    const { schema, state, limits, edits, lead } = twin;
    if (schema === null || state === null || limits === null || edits.size === 0) return;
    if (table?.schema !== schema) table = { schema, of: new SensorTable(schema) };
    const before = own.log.crossings;
    for (const { codes, atMs } of [...(lead ?? []), state])
      own.log.look(table.of.read(codes, limits), limits, atMs);
    if (own.log.crossings !== before) own.changed.emit();
  });
}

/** Records a reading computed by the page, in a group with this title, and compares it with its limit. */
export function noteComputed(
  twin: RobotTwin,
  title: string,
  reading: Parameters<LimitLog['note']>[1],
  limit: { readonly threshold: Threshold; readonly own: boolean },
  atMs: number,
): void {
  const own = ownOf(twin);
  const before = own.log.crossings;
  own.log.note(title, reading, limit.threshold, atMs, limit.own);
  if (own.log.crossings !== before) own.changed.emit();
}

/** Forgets the crossings from a moment on, or all of them: the following data does not continue from them. A value beyond its
 *  limit in the first frame then does not count as a crossing, because its time is unknown. */
export function forgetOwnAlarms(twin: RobotTwin, sinceMs = Number.NEGATIVE_INFINITY): void {
  const own = ownOf(twin);
  own.log.begin(sinceMs);
  own.changed.emit();
}

/** The newest crossings of limits that this page alone watches, newest last; empty if there were none or limits are not watched. */
export function ownAlarms(twin: RobotTwin): readonly Crossing[] {
  return ownOf(twin).log.crossings;
}

/** Watches the viewer's own limits and calls `listener` after each new crossing. Returns a function that removes the
 *  listener; the limits stay watched. */
export function onOwnAlarms(twin: RobotTwin, listener: () => void): () => void {
  watchOwnLimits(twin);
  return ownOf(twin).changed.on(listener);
}
