import { History } from '../../twin/plots/history.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { LastReadings } from '../../twin/sensors/last_readings.ts';

/** Records the last minute of a robot's values and the last readings of its sensors. It begins when the page opens, so
 *  that a card that is opened later can show the time before. */
export class HistoryKeeper {
  readonly history = new History();
  readonly readings = new LastReadings();
  /** Forgets the recorded values: the following data is from another time. */
  begin(): void {
    this.history.clear();
    this.readings.clear();
  }

  /** Stops recording. */
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
