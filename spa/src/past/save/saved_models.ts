import type { Manifest } from '../../model/manifest.ts';
import type { SavePorts } from './save_ports.ts';
import type { SavedBalance } from './saved_balance.ts';
import { modelsOf } from './saved_frames.ts';
import type { SavedSpan } from './saved_span.ts';

/** The manifests of the models of a span, by hash; null of one that can't be had. Rejects with the reason of the signal. */
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

/** What reads the balance of a span's frames with these models; null where it has none. The code for it, with that which draws
 *  balance, comes only where a model can be had. */
export async function loadBalance(
  { schemas }: Pick<SavedSpan, 'schemas'>,
  manifests: ReadonlyMap<string, Manifest | null>,
): Promise<SavedBalance | null> {
  const models = [...manifests.values()].filter((manifest) => manifest !== null);
  if (models.length === 0) return null;
  const { SavedBalance } = await import('./saved_balance.ts');
  return SavedBalance.of(models, [...schemas.values()]);
}

/** Which model the robot had, for moments that are asked for in the order of time. */
export class ModelTimeline {
  readonly #models: ReturnType<typeof modelsOf>;

  constructor(span: SavedSpan) {
    this.#models = modelsOf(span);
  }

  /** Its hash; null without one. `atUs`: unix. */
  at(atUs: number): string | null {
    while (this.#models.length > 1 && this.#models[1]!.atUs <= atUs) this.#models.shift();
    return this.#models[0]?.model ?? null;
  }
}
