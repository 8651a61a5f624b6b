import type { Schema } from '@posecast/wire';
import { BalanceReader } from '../../model/balance/balance_reader.ts';
import type { Manifest } from '../../model/manifest.ts';
import type { Balance } from '../../twin/balance/balance.ts';
import type { SavedFrame } from './saved_span.ts';

/** The balance of the past, frame by frame in order. */
export class SavedBalance {
  #reader: BalanceReader | null = null;

  /** null if none of these models has a balance in frames of any of these schemas. */
  static of(models: readonly Manifest[], schemas: readonly Schema[]): SavedBalance | null {
    const has = models.some((model) => schemas.some((schema) => new BalanceReader(model, schema).hasAny));
    return has ? new SavedBalance() : null;
  }

  /** The balance of a frame; null if its model (null: none) has neither masses nor known feet. It is overwritten by the next
   *  call. */
  read({ schema, codes, tS }: SavedFrame, manifest: Manifest | null): Balance | null {
    if (manifest === null) {
      this.#reader = null;
      return null;
    }
    // each decoder has one schema
    if (this.#reader?.manifest !== manifest || this.#reader.schema.text !== schema.text)
      this.#reader = new BalanceReader(manifest, schema);
    return this.#reader.hasAny ? this.#reader.ofFrame(codes, tS) : null;
  }
}
