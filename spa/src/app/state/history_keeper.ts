import { History } from '../../twin/plots/history.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { LastReadings } from '../../twin/sensors/last_readings.ts';

/** Remembers the last minute and the last readings from the moment the page opens, so that a card that is opened later has
 *  a past. */
export class HistoryKeeper {
  readonly history = new History();
  readonly readings = new LastReadings();
  readonly close: () => void;

  constructor(twin: RobotTwin) {
    this.close = twin.onState(() => {
      const { schema, state } = twin;
      if (schema === null || state === null) return;
      this.history.push(schema, state);
      this.readings.push(schema, state);
    });
  }
}
