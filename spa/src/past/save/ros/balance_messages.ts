import type { Balance } from '../../../twin/balance/balance.ts';
import type { Vec3 } from '../../../twin/rotation.ts';
import type { CdrWriter } from './cdr_writer.ts';
import type { MessageType } from './definitions.ts';
import { writeHeader } from './stamp.ts';

const NOWHERE: Vec3 = [Number.NaN, Number.NaN, Number.NaN];

interface BalanceMessage {
  readonly topic: string;
  readonly type: MessageType;
  write(to: CdrWriter): void;
}

/** The messages for a frame's balance, with NaN for missing values. Messages that this robot can't have (without masses or feet)
 *  are omitted. `world`: the points' frame of reference, as UTF-8; `atUs`: unix. */
export function balanceMessages(
  balance: Balance,
  world: Uint8Array,
  atUs: number,
): readonly BalanceMessage[] {
  const { massKg, feet, centreOfMass, pressure, capturePoint, marginM } = balance;
  const hasMasses = massKg > 0;
  const hasFeet = feet.length > 0;
  const point = (topic: string, at: Vec3 | null): BalanceMessage => ({
    topic,
    type: 'geometry_msgs/msg/PointStamped',
    write: (to) => {
      to.begin();
      writeHeader(to, atUs, world);
      for (const value of at ?? NOWHERE) to.f64(value);
    },
  });
  const margin: BalanceMessage = {
    topic: '/balance/margin',
    type: 'std_msgs/msg/Float64',
    write: (to) => {
      to.begin();
      to.f64(marginM ?? Number.NaN);
    },
  };
  return [
    ...(hasMasses ? [point('/balance/centre_of_mass', centreOfMass)] : []),
    ...(hasFeet ? [point('/balance/centre_of_pressure', pressure)] : []),
    ...(hasMasses && hasFeet ? [point('/balance/capture_point', capturePoint), margin] : []),
  ];
}
