import type { Manifest } from '../../model/manifest.ts';
import type { SavePorts } from './save_ports.ts';
import type { SavedBalance } from './saved_balance.ts';
import { modelsOf } from './saved_frames.ts';
import type { SavedSpan } from './saved_span.ts';

/** The manifests of the models in a span, by hash; null for one that is unavailable. Rejects with the reason of the signal. */
export async function loadManifests(
  span: SavedSpan,
  { models, signal }: Pick<SavePorts, 'models' | 'signal'>,
): Promise<ReadonlyMap<string, Manifest | null>> {
  const manifests = new Map<string, Manifest | null>();
  for (const { model } of modelsOf(span)) {
    if (model === null || manifests.has(model)) continue;
    signal.throwIfAborted();
    manifests.set(model, await models.manifest(model).catch(() => null));
  }
  return manifests;
}

/** Reads the balance of a span's frames with these models; null if there is none. The code, which also draws balance, is loaded
 *  only if a model is available. */
export async function loadBalance(
  { schemas }: Pick<SavedSpan, 'schemas'>,
  manifests: ReadonlyMap<string, Manifest | null>,
): Promise<SavedBalance | null> {
  const models = [...manifests.values()].filter((manifest) => manifest !== null);
  if (models.length === 0) return null;
  const { SavedBalance } = await import('./saved_balance.ts');
  return SavedBalance.of(models, [...schemas.values()]);
}

/** The robot's model at moments, which must be requested in time order. */
export class ModelTimeline {
  readonly #models: ReturnType<typeof modelsOf>;

  constructor(span: SavedSpan) {
    this.#models = modelsOf(span);
  }

  /** Its hash; null without a model. `atUs`: unix. */
  at(atUs: number): string | null {
    while (this.#models.length > 1 && this.#models[1]!.atUs <= atUs) this.#models.shift();
    return this.#models[0]?.model ?? null;
  }
}
