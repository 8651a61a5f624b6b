import { BundleError } from '../../model/bundle.ts';
import { lodBytes, manifestAt } from '../../model/files.ts';
import { readLod } from '../../model/lod.ts';
import { type Manifest, readManifest } from '../../model/manifest.ts';
import { type LightColors, linear } from './colors.ts';
import { LightRobot } from './robot.ts';

/** Creates a robot from a built model's manifest. Rejects with a one-line Error if it can't be shown at all. */
export async function loadRobot(manifestUrl: string, tones: LightColors): Promise<LightRobot> {
  const raw = await manifestAt(manifestUrl);
  if (raw.v !== 2) throw new Error('only a built model can be shown without 3D');
  return new LightRobot(readManifest(raw), tones);
}

/** Loads and shows the coarsest level, if there is one. Rejects with a one-line Error that names the file. */
export async function loadShells(
  robot: LightRobot,
  manifestUrl: string,
  signal: AbortSignal,
  onProgress: (receivedBytes: number, totalBytes: number) => void,
): Promise<void> {
  const { levels, visuals }: Manifest = robot.manifest;
  const lowest = levels[0];
  if (lowest === undefined) return;
  const bytes = await lodBytes(lowest, manifestUrl, signal, (received) => onProgress(received, lowest.bytes));
  const level = await readLod(bytes, visuals.length).catch((cause: unknown) => {
    throw new BundleError(`${lowest.path}: ${cause instanceof Error ? cause.message : String(cause)}`, {
      cause,
    });
  });
  const means = await Promise.all(level.pictures.map(meanColor));
  signal.throwIfAborted();
  robot.wear(level, means);
}

/** The mean colour (linear) of a texture, used instead of the texture in the light view; null if it can't be read. */
async function meanColor(picture: Blob): Promise<readonly [number, number, number] | null> {
  try {
    const bitmap = await createImageBitmap(picture, {
      resizeWidth: 1,
      resizeHeight: 1,
      resizeQuality: 'medium',
    });
    const canvas = document.createElement('canvas');
    canvas.width = canvas.height = 1;
    const context = canvas.getContext('2d');
    context?.drawImage(bitmap, 0, 0);
    const data = context?.getImageData(0, 0, 1, 1).data;
    if (data === undefined) return null;
    return [linear(data[0]! / 255), linear(data[1]! / 255), linear(data[2]! / 255)];
  } catch {
    return null;
  }
}
