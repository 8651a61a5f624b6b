import type { Schema } from '@posecast/wire';
import type { BalanceReader } from '../../model/balance/balance_reader.ts';
import type { Manifest } from '../../model/manifest.ts';
import type { Balance } from '../../twin/balance/balance.ts';
import type { SavedFrame } from './saved_frames.ts';

/** The balance of the past, frame by frame in their order. */
export class SavedBalance {
  readonly #Reader: typeof BalanceReader;
  #reader: BalanceReader | null = null;

  constructor(Reader: typeof BalanceReader) {
    this.#Reader = Reader;
  }

  /** The balance of a frame; null where its model (null: none) has no masses and stands on nothing known. It is rewritten
   *  by the next call. */
  read({ schema, codes, tS }: SavedFrame, manifest: Manifest | null): Balance | null {
    if (manifest === null) {
      this.#reader = null;
      return null;
    }
    // decoders have a schema each
    if (this.#reader?.manifest !== manifest || this.#reader.schema.text !== schema.text)
      this.#reader = new this.#Reader(manifest, schema);
    return this.#reader.hasAny ? this.#reader.ofFrame(codes, tS) : null;
  }
}

/** What reads the balance of frames of these schemas; null where none of these models has any. Its code is the one that
 *  draws balance, and comes only where there is a model. */
export async function loadSavedBalance(
  manifests: Iterable<Manifest | null>,
  schemas: Iterable<Schema>,
): Promise<SavedBalance | null> {
  const models = [...manifests].filter((manifest) => manifest !== null);
  if (models.length === 0) return null;
  const { BalanceReader: Reader } = await import('../../model/balance/balance_reader.ts');
  const all = [...schemas];
  const has = models.some((manifest) => all.some((schema) => new Reader(manifest, schema).hasAny));
  return has ? new SavedBalance(Reader) : null;
}
