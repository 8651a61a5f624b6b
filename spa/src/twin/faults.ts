import type { JointRow } from './joints.ts';

export interface ActiveFault {
  label: string;
  plain: string | null;
  /** "jam, PWM saturated" */
  words: string;
  sinceMs: number;
}

/** Which joints are in trouble now, worst and oldest first, and since when this page has seen it. */
export class FaultWatch {
  readonly #since = new Map<string, number>();

  update(rows: readonly JointRow[], nowMs: number): ActiveFault[] {
    const active: ActiveFault[] = [];
    for (const row of rows) {
      if (row.level !== 'fault') {
        this.#since.delete(row.label);
        continue;
      }
      const sinceMs = this.#since.get(row.label) ?? nowMs;
      this.#since.set(row.label, sinceMs);
      active.push({ label: row.label, plain: row.plain, words: faultWords(row), sinceMs });
    }
    return active.sort((a, b) => a.sinceMs - b.sinceMs);
  }
}

function faultWords(row: JointRow): string {
  const words = row.flags.filter((flag) => flag.severity === 'fault').map((flag) => flag.words);
  if (row.curLevel === 'fault') words.push('current over its limit');
  if (row.tempLevel === 'fault') words.push('too hot');
  return words.join(', ');
}
