import { writeCsv } from './csv_file.ts';
import { writePosecast } from './posecast_file.ts';
import type { SaveFormat, SavePorts } from './save_ports.ts';
import type { SavedSpan } from './saved_span.ts';

/** Writes a span as a file. `onPart` receives the progress, 0…1; `lostModels`: how many models were unavailable. Rejects with the
 *  reason of the signal. */
export function writeSpan(
  format: SaveFormat,
  span: SavedSpan,
  ports: Pick<SavePorts, 'models' | 'breathe' | 'signal'>,
  onPart: (part: number) => void,
): Promise<{ readonly blob: Blob; readonly lostModels: number }> {
  switch (format) {
    case 'csv':
      return writeCsv(span, ports, onPart);
    case 'posecast':
      return writePosecast(span, ports, onPart);
  }
}
