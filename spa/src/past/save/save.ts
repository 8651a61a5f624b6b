/** Saves a span of a robot's past as one file: a separate chunk, loaded only for saving. */

import type { Span } from '../past_types.ts';
import type { Lost, SaveFormat, SavePorts } from './save_ports.ts';
import { loadSpan } from './saved_span.ts';
import { writeSpan } from './write_span.ts';

export { type Measure, measureSpan } from './measure.ts';
export { SaveError } from './save_ports.ts';

/** The share of the work that is done once all segments are loaded. */
const LOADED = 0.5;

export interface SavedFile {
  readonly blob: Blob;
  readonly name: string;
  readonly lost: Lost;
}

/** Saves a span, including its ends, unix ms. Rejects with a `SaveError`, or with the reason of the signal. */
export async function saveSpan(format: SaveFormat, span: Span, ports: SavePorts): Promise<SavedFile> {
  const { onProgress } = ports;
  const whole = { fromMs: Math.floor(span.fromMs), toMs: Math.floor(span.toMs) };
  const loaded = await loadSpan(ports, whole, (part) => onProgress(LOADED * part));
  const { blob, lostModels } = await writeSpan(format, loaded, ports, (part) =>
    onProgress(LOADED + (1 - LOADED) * part),
  );
  const { robot } = loaded.segments[0]!.segment.start;
  const lost = { segments: loaded.lostSegments, models: lostModels };
  return { blob, name: fileName(robot, whole.fromMs, format), lost };
}

/** `demo_2026-11-22_14-02-07.csv`, in the viewer's time zone, like all moments on the page. */
export function fileName(robot: string, fromMs: number, format: SaveFormat): string {
  const at = new Date(fromMs);
  const two = (part: number) => String(part).padStart(2, '0');
  const day = [at.getFullYear(), two(at.getMonth() + 1), two(at.getDate())].join('-');
  const time = [at.getHours(), at.getMinutes(), at.getSeconds()].map(two).join('-');
  return `${robot}_${day}_${time}.${format}`;
}
