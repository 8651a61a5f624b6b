import type { EventMessage, Field, Schema } from '@posecast/wire';
import { type CdrWriter, utf8Of } from './cdr_writer.ts';
import type { FrameTopic } from './frame_topic.ts';
import { jointTopicsOf } from './joint_topics.ts';
import { sensorTopicsOf } from './sensor_topics.ts';
import { writeStamp } from './stamp.ts';

/** Of rcl_interfaces/msg/Log. */
const LEVELS = { fault: 40, caution: 30, info: 20 } as const;

/** The topics for the frames of a schema. A field gets its own topic only if no other message contains all of it, so that nothing
 *  is left out; then come those of sensors and joints. The order matters: /joint_states is last, because a player that merges
 *  topics, such as an edge, publishes all others with it. `rootLink`: the model's root; null without a model. */
export function topicsOf(schema: Schema, rootLink: string | null): FrameTopic[] {
  const topics = [...sensorTopicsOf(schema, rootLink), ...jointTopicsOf(schema)];
  const carried = new Set(topics.flatMap((topic) => [...topic.carried]));
  const isLeft = ({ start, size }: Field) =>
    Array.from({ length: size }, (_, i) => start + i).some((channel) => !carried.has(channel));
  return [...schema.fields.filter(isLeft).map((field) => plainTopic(schema, field)), ...topics];
}

/** Writes an event as a log line; the end of an event has level INFO. */
export function writeLog(to: CdrWriter, atUs: number, { level, source, text, state }: EventMessage): void {
  const isOver = state === 'off';
  to.begin();
  writeStamp(to, atUs);
  to.u8(isOver ? LEVELS.info : LEVELS[level]);
  to.text(source);
  to.text(isOver ? `${text}: over` : text);
  to.text(''); // file
  to.text(''); // function
  to.u32(0);
}

function plainTopic(schema: Schema, field: Field): FrameTopic {
  const { start, size, labels } = field;
  const sites = utf8Of(labels.join(','));
  return {
    name: `/posecast/${field.name}`,
    type: 'std_msgs/msg/Float64MultiArray',
    carried: new Set(),
    units: unitsOf(schema, field),
    write: (to, _atUs, values) => {
      to.begin();
      to.u32(1); // dimensions
      to.utf8(sites);
      to.u32(size);
      to.u32(size); // stride
      to.u32(0); // offset
      to.f64s(values.subarray(start, start + size));
    },
  };
}

function unitsOf({ mapping }: Schema, { name, unit, labels }: Field): Map<string, string> {
  const units = new Map<string, string>();
  if (unit !== '') units.set('unit', unit);
  for (const label of labels) {
    const own = mapping.unit(name, label) ?? '';
    if (own !== '') units.set(`unit.${label}`, own);
  }
  return units;
}
