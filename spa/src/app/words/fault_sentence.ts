import type { Fault, FaultLog } from '../../twin/alarms/fault_log.ts';
import { fillSentence, sentenceOf } from '../../twin/alarms/sentence.ts';
import { coarseDisplay, displayOf, formatNumber, formatSpan } from '../../twin/format.ts';
import { isolated, wordsOfName } from '../../twin/names.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { settings } from '../state/settings.ts';
import { languageTag, more } from '../text/language.ts';

/** Faults that belong to no joint or sensor, in any language. */
const PART_REPORTED = '{joint}: {word}';

/** A fault in words for someone who did not build the robot. */
export interface FaultSentence {
  /** "Right knee is not where it was told to be: 0.40 rad off for 14 s."; once it is over, "Earlier: Right knee is blocked." */
  readonly said: string;
  /** The joint's code, shown in small type beside the sentence ("RKN"); empty if the sentence contains it, as it does for joints
   *  that have only a code. */
  readonly code: string;
  /** The bit of a flag fault, whose word is also shown; null for other faults. */
  readonly bit: string | null;
  /** Whether the sentence includes the fault's duration. */
  readonly aged: boolean;
}

/** The sentence for a fault at `nowMs` (Unix ms), in the page's language. */
export function faultSentence(twin: RobotTwin, log: FaultLog, fault: Fault, nowMs: number): FaultSentence {
  const { schema } = twin;
  const { source, what, words } = fault;
  const name = wordsOfName(schema, source, languageTag());
  let aged = false;
  const textOf = (place: string): string | null => {
    switch (place) {
      case 'joint':
        return name ?? source;
      case 'word':
        return words;
      case 'age': {
        const age = ageOf(log, fault, nowMs);
        aged ||= age !== null;
        return age;
      }
      default:
        return fault.clearedMs === null ? valueWords(twin, source, place) : null;
    }
  };
  const say = sayOf(twin, fault);
  let said = fillSentence(say, textOf);
  if (name !== null) {
    if (said.startsWith(name)) said = said[0]!.toUpperCase() + said.slice(1);
  } else if (said === fillSentence(say, (place) => (place === 'joint' ? '' : textOf(place)))) {
    said = `${source}: ${said}`; // otherwise the sentence would not name the joint
  }
  const bit = what === 'flag' ? bitOf(fault) : null;
  const shown = isolated(said);
  return {
    said: fault.clearedMs === null ? shown : more().itWas(shown),
    code: name === null ? '' : isolated(source),
    bit,
    aged,
  };
}

/** "3rd time in 10 min"; empty for the first. */
export function timesWords(log: FaultLog, { key }: Fault, nowMs: number): string {
  const times = log.occurrences.times(key, nowMs);
  if (times < 2) return '';
  return times < log.occurrences.most ? more().timesLately(times) : more().manyTimesLately(times);
}

/** The bit of a flag's fault, as the robot names it. */
function bitOf({ key }: Fault): string {
  return key.slice(key.indexOf('\n') + 1);
}

function sayOf(twin: RobotTwin, fault: Fault): string {
  if (fault.what !== 'flag') return more()[`${fault.what}Sentence`];
  const isPart = twin.schema?.fields.some(({ labels }) => labels.includes(fault.source)) ?? false;
  const told = sentenceOf(twin.schema, fault.source, bitOf(fault), languageTag());
  return told?.say ?? (isPart ? more().flagReported : PART_REPORTED);
}

function ageOf(log: FaultLog, { key, firstMs, clearedMs }: Fault, nowMs: number): string | null {
  if (clearedMs !== null) return null;
  const seconds = Math.floor((nowMs - (log.occurrences.newestMs(key) ?? firstMs)) / 1000);
  if (seconds < 1) return null;
  return seconds < 10 ? `${seconds} s` : formatSpan(seconds * 1000);
}

/** A value of the joint with its unit, "0.40 rad"; null if it has no reading now or does not exist. */
function valueWords(twin: RobotTwin, source: string, place: string): string | null {
  const fieldName = place === 'error' ? 'pos' : place;
  const of = (name: string) => twin.value(name, source) ?? null;
  const [ref, pos] = [of('ref'), of('pos')];
  const value = place !== 'error' ? of(place) : ref === null || pos === null ? null : Math.abs(ref - pos);
  if (value === null) return null;
  const field = twin.schema?.field(fieldName);
  const unit = twin.schema?.mapping.unit(fieldName, source) ?? field?.unit ?? '';
  const display = coarseDisplay(displayOf(unit, settings().angle, field?.scale));
  return `${formatNumber(value, display).trim()} ${display.unit}`.trim();
}
