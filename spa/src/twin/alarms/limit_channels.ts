import { JOINT, type Schema } from '@posecast/wire';
import { MARGIN } from '../balance/stance.ts';
import { limitedNames, numberOf } from '../joints.ts';
import { ANY } from '../limits.ts';
import { SensorTable, type SensorWords } from '../sensors/sensors.ts';

/** A channel for which a viewer may set limits. */
export interface LimitChannel {
  readonly field: string;
  readonly label: string;
  readonly name: string;
  readonly unit: string;
  /** The slider's range is −span to +span. */
  readonly span: number;
}

export interface LimitChannelGroup {
  readonly title: string;
  readonly channels: readonly LimitChannel[];
  /** An additional line about the group. */
  readonly note?: string;
}

/** Default spans by field, in the field's unit, for channels without limits in the profile. */
const SPANS: Readonly<Record<string, number>> = {
  ftf: 1000,
  ftm: 100,
  volt: 60,
  amp: 50,
  [MARGIN.field]: 100,
};
/** The texts in the viewer's language. */
export interface LimitChannelWords extends SensorWords {
  readonly motors: string;
  readonly curOfAll: string;
  readonly tempOfAll: string;
}

/** The texts about balance. */
interface BalanceLimitWords {
  readonly balance: string;
  readonly margin: string;
  readonly withoutLimit: string;
}

/** The channels for which a viewer may set limits: forces and moments by site, the balance margin if there are texts for it,
 *  power, and current and temperature with one limit for all joints. */
export function limitChannels(
  schema: Schema,
  words: LimitChannelWords,
  ofBalance: BalanceLimitWords | null = null,
): LimitChannelGroup[] {
  const span = (field: string, label: string) => {
    const { low, high } = schema.mapping.threshold(field, label) ?? { low: null, high: null };
    const most = 1.5 * Math.max(Math.abs(low ?? 0), Math.abs(high ?? 0));
    return most > 0 ? most : (numberOf(field)?.span ?? SPANS[field] ?? 100);
  };
  const groups: LimitChannelGroup[] = [];
  for (const group of new SensorTable(schema, words).groups) {
    if (group.kind !== 'wrench' && group.kind !== 'power') continue;
    groups.push({
      title: group.title,
      channels: group.readings.map(({ field, label, name, unit }) => ({
        ...{ field, label, name, unit, span: span(field, label) },
      })),
    });
  }
  const loads = limitedNames().flatMap((name) => {
    const field = schema.field(name);
    if (field?.labelSet !== JOINT) return [];
    return [
      {
        field: name,
        label: ANY,
        name: words[`${name}OfAll`],
        unit: field.unit,
        span: span(name, ANY),
      },
    ];
  });
  if (ofBalance !== null) {
    const { field, label } = MARGIN;
    groups.push({
      title: ofBalance.balance,
      channels: [{ ...MARGIN, name: ofBalance.margin, unit: 'mm', span: span(field, label) }],
      note: ofBalance.withoutLimit,
    });
  }
  if (loads.length > 0) groups.push({ title: words.motors, channels: loads });
  return groups;
}
