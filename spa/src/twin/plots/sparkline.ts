import type { TraceHistory } from './history.ts';

/** A longer gap between samples breaks the line. */
const GAP_S = 1.5;

/** SVG path data of each trace, and the range of values that the height represents. */
export interface Strip {
  paths: string[];
  low: number;
  high: number;
}

/**
 * SVG path data for each trace in a box of width × height, all on one scale; null if none has a reading.
 *
 * The width represents `spanS` seconds, the last `laterS` of them after now. The height represents at least `leastRange` (above
 * 0, in the unit of the values), so that the noise of a joint at rest does not fill the picture.
 */
export function strip(
  traces: readonly TraceHistory[],
  width: number,
  height: number,
  spanS: number,
  leastRange: number,
  laterS = 0,
): Strip | null {
  let low = Number.POSITIVE_INFINITY;
  let high = Number.NEGATIVE_INFINITY;
  for (const { values } of traces) {
    for (const value of values) {
      if (value === null) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  if (low > high) return null;
  const missing = leastRange - (high - low);
  if (missing > 0) {
    low -= missing / 2;
    high += missing / 2;
  }
  const x = (agoS: number) => round((1 + (agoS - laterS) / spanS) * width);
  const y = (value: number) => round((1 - (value - low) / (high - low)) * height);
  const paths = traces.map(({ agoS, values }) => {
    let path = '';
    let penS = Number.NEGATIVE_INFINITY;
    values.forEach((value, i) => {
      const at = agoS[i]!;
      if (value === null) {
        penS = Number.NEGATIVE_INFINITY;
        return;
      }
      path += `${at - penS > GAP_S ? 'M' : 'L'}${x(at)} ${y(value)}`;
      penS = at;
    });
    return path;
  });
  return { paths, low, high };
}

function round(value: number): number {
  return Math.round(value * 10) / 10;
}
