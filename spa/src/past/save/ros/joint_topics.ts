import { type Field, JOINT, type Schema } from '@posecast/wire';
import { utf8Of } from './cdr_writer.ts';
import {
  carriedBy,
  channelFactor,
  compute,
  type FrameTopic,
  NO_READING,
  placeOf,
  type Reading,
  readingOf,
  stampedTopic,
  type Term,
  unlessEmpty,
  type WriteBody,
} from './frame_topic.ts';

const NO_LINK = new Uint8Array();

type Row = readonly Reading[] | null;

/** The commanded and measured joint values. Joints are named as in the schema's mapping; a channel outside the mapping names the
 *  joint that it moves. */
export function jointTopicsOf(schema: Schema): FrameTopic[] {
  const [pos, ref] = [schema.field('pos'), schema.field('ref')];
  const [vel, effort] = [schema.field('vel'), schema.field('effort')];
  const main = pos ?? ref;
  const named = [pos, vel, effort].find((field) => field !== null && namesOf(schema, field).length > 0);
  const names = namesOf(schema, named ?? null);
  const wanted = namesOf(schema, ref);
  return [
    ...topicOf('/joint_references', wanted, [positionsOf(schema, ref, wanted), null, null]),
    ...topicOf('/joint_states', names, [
      positionsOf(schema, pos, names),
      ratesOf(schema, vel, main, names),
      effortsOf(schema, effort, main, names),
    ]),
  ];
}

/** The joints moved by a field, from the mapping in the wire format. */
function namesOf(schema: Schema, field: Field | null): readonly string[] {
  if (field === null) return [];
  const own = field.labelSet === JOINT ? field.labels : [];
  return [...new Set([...own, ...schema.mapping.joints.keys()])];
}

/** `rows`: position, velocity and effort. Null if the robot has none of them. */
function topicOf(name: string, names: readonly string[], rows: readonly [Row, Row, Row]): FrameTopic[] {
  if (rows.every((row) => row === null)) return [];
  const texts = names.map((joint) => utf8Of(joint));
  const carried = carriedBy(rows.flatMap((row) => row ?? []));
  const writeBody: WriteBody = (to, values) => {
    to.u32(texts.length);
    for (const text of texts) to.utf8(text);
    for (const row of rows) {
      to.u32(row?.length ?? 0);
      for (const reading of row ?? []) to.f64(compute(reading, values));
    }
  };
  return [stampedTopic(name, 'sensor_msgs/msg/JointState', NO_LINK, carried, writeBody)];
}

function positionsOf(schema: Schema, field: Field | null, names: readonly string[]): Row {
  if (field === null) return null;
  return unlessEmpty(
    names.map((name) => {
      const how = schema.mapping.joints.get(name);
      if (how === undefined) return readingOf(schema, field, name, 'position');
      // the mapping's results are rad or m
      const terms = how.terms.map(([channel, gain]) => ({ channel: placeOf(field, channel), gain }));
      return { terms, offset: how.offset };
    }),
  );
}

/** Σ ratio · channel speed: a ratio is a gain without the position's unit factor. */
function ratesOf(schema: Schema, field: Field | null, main: Field | null, names: readonly string[]): Row {
  if (field === null || field.labelSet !== JOINT) return null;
  return unlessEmpty(
    names.map((name) => {
      const how = schema.mapping.joints.get(name);
      if (how === undefined) return readingOf(schema, field, name, 'velocity');
      const terms = how.terms.map(([channel, gain]): Term => {
        const factor = channelFactor(schema, field, channel, 'velocity');
        const ratio = ratioOf(schema, main, channel, gain);
        if (factor === null || ratio === null) return { channel: null, gain: 1 };
        return { channel: placeOf(field, channel), gain: factor * ratio };
      });
      return { terms, offset: 0 };
    }),
  );
}

/** If one channel moves one joint: effort of the channel / ratio. If several do, the distribution is unknown. */
function effortsOf(schema: Schema, field: Field | null, main: Field | null, names: readonly string[]): Row {
  if (field === null || field.labelSet !== JOINT) return null;
  const uses = [...schema.mapping.joints.values()].flatMap(({ terms }) => terms.map(([channel]) => channel));
  return unlessEmpty(
    names.map((name) => {
      const how = schema.mapping.joints.get(name);
      if (how === undefined) return readingOf(schema, field, name, 'effort');
      const [channel, gain] = how.terms.length === 1 ? how.terms[0]! : ['', 0];
      const factor = channelFactor(schema, field, channel, 'effort');
      const ratio = ratioOf(schema, main, channel, gain);
      const isShared = uses.filter((each) => each === channel).length !== 1;
      if (factor === null || ratio === null || ratio === 0 || isShared) return NO_READING;
      return { terms: [{ channel: placeOf(field, channel), gain: factor / ratio }], offset: 0 };
    }),
  );
}

function ratioOf(schema: Schema, main: Field | null, channel: string, gain: number): number | null {
  const factor = main === null ? 1 : channelFactor(schema, main, channel, 'position');
  return factor === null ? null : gain / factor;
}
