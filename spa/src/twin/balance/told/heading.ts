import type { Schema } from '@posecast/wire';
import { baseOf } from '../../playback/pose.ts';
import { invertQuat, multiplyQuats, type Quat, rpyOf } from '../../rotation.ts';
import { ImuTable } from '../../sensors/imus.ts';

/** Reads where a robot faces: by its odometry, else by the sensor that says how its body is turned, else along the world's x. */
export class HeadingReader {
  readonly #schema: Schema;
  readonly #imus: ImuTable;

  constructor(schema: Schema) {
    this.#schema = schema;
    this.#imus = new ImuTable(schema);
  }

  /** Rad from the world's x, of a frame's codes. */
  read(codes: Int32Array): number {
    const base = baseOf(this.#schema, codes);
    if (base !== null) return yawOf(base.quat_wxyz);
    this.#imus.read(codes);
    const { body } = this.#imus;
    if (body?.heading !== true || body.worldFromSensor === null) return 0;
    return yawOf(multiplyQuats(body.worldFromSensor, invertQuat(body.linkFromSensor)));
  }
}

function yawOf(quat: Quat): number {
  return rpyOf(quat)[2];
}
