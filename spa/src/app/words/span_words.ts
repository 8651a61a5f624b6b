import { say } from '../text/language.ts';

/** A duration in whole units: "9 s", "2 min". */
export function spanWords(ms: number): string {
  const text = say();
  if (ms < 119_500) return text.seconds(Math.round(ms / 1000));
  if (ms < 7_170_000) return text.minutes(Math.round(ms / 60_000));
  const days = Math.round(ms / 86_400_000);
  return days >= 2 ? text.days(days) : text.hours(Math.round(ms / 3_600_000));
}
