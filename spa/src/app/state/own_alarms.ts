import { type Crossing, LimitLog } from '../../twin/alarms/limit_log.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { SensorTable } from '../../twin/sensors/sensors.ts';

/** The crossings of the viewer's own limits for one robot, and who listens for them. */
interface OwnAlarms {
  readonly log: LimitLog;
  readonly listeners: Set<() => void>;
}

const kept = new WeakMap<RobotTwin, OwnAlarms>();
const NONE: readonly Crossing[] = [];

/** Checks the viewer's own limits in every frame from now on. A second call for the same robot does nothing. */
export function watchOwnLimits(twin: RobotTwin): void {
  if (kept.has(twin)) return;
  const own: OwnAlarms = { log: new LimitLog(), listeners: new Set() };
  kept.set(twin, own);
  let table: { schema: RobotTwin['schema']; of: SensorTable } | null = null;
  twin.onState(() => {
    const { schema, state, limits, edits } = twin;
    if (schema === null || state === null || limits === null || edits.size === 0) return;
    if (table?.schema !== schema) table = { schema, of: new SensorTable(schema) };
    if (!own.log.look(table.of.read(state.codes, limits), limits, state.atMs)) return;
    for (const listener of own.listeners) listener();
  });
}

/** The newest crossings of the viewer's own limits, newest last; empty if there were none or limits are not watched. */
export function ownAlarms(twin: RobotTwin): readonly Crossing[] {
  return kept.get(twin)?.log.crossings ?? NONE;
}

/** Watches the viewer's own limits and calls `listener` after each new crossing. Returns a function that removes the
 *  listener; the limits stay watched. */
export function onOwnAlarms(twin: RobotTwin, listener: () => void): () => void {
  watchOwnLimits(twin);
  const { listeners } = kept.get(twin)!;
  listeners.add(listener);
  return () => listeners.delete(listener);
}
