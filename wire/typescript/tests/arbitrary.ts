/** Schemas, codes and streams for property tests. */

import fc from 'fast-check';
import { CODE_MAX, MISSING, parseSchema, type Schema } from '../src/index.ts';

interface Draft {
  readonly set: number;
  readonly rel: number;
  readonly bits: boolean;
  readonly scale: number;
}

/** One to five fields over three label sets, some of them relative to an earlier one of their size. */
export function someSchema(): fc.Arbitrary<Schema> {
  const draft = fc.record<Draft>({
    set: fc.nat({ max: 2 }),
    rel: fc.integer({ min: -2, max: 4 }),
    bits: fc.boolean(),
    scale: fc.constantFrom(0.001, 0.05, 1, 2.5),
  });
  return fc.array(draft, { minLength: 1, maxLength: 5 }).map((drafts) =>
    parseSchema(
      JSON.stringify({
        type: 'schema',
        v: 1,
        robot: 'r',
        labels: { s0: ['x'], s1: ['x', 'y', 'z'], s2: Array.from({ length: 17 }, (_, i) => `j${i}`) },
        fields: drafts.map(({ set, rel, bits, scale }, i) => ({
          name: `f${i}`,
          labels: `s${set}`,
          ...(rel >= 0 && rel < i && drafts[rel]!.set === set ? { rel: `f${rel}` } : {}),
          ...(bits ? { bits: ['a', 'b'] } : { scale }),
        })),
      }),
    ),
  );
}

/** Codes of the whole range: ends and MISSING often, small ones mostly. */
export function someCodes(size: number): fc.Arbitrary<number[]> {
  const code = fc.oneof(
    { weight: 4, arbitrary: fc.integer({ min: -40, max: 40 }) },
    { weight: 1, arbitrary: fc.constantFrom(MISSING, -CODE_MAX, CODE_MAX) },
    { weight: 1, arbitrary: fc.integer({ min: MISSING, max: CODE_MAX }) },
  );
  return fc.array(code, { minLength: size, maxLength: size });
}

export interface AStream {
  readonly schema: Schema;
  readonly states: number[][];
}

export function aStream(): fc.Arbitrary<AStream> {
  return someSchema().chain((schema) =>
    fc.record({
      schema: fc.constant(schema),
      states: fc.array(someCodes(schema.size), { minLength: 1, maxLength: 14 }),
    }),
  );
}
