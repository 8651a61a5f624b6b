import { expect, it } from 'vitest';
import { BalanceReader } from '../src/model/balance/balance_reader.ts';
import { FrameBody } from '../src/model/balance/frame_body.ts';
import { readBalanceCases, tellBalance } from './balance_vectors.ts';

/** What codes of the vectors are rounded to: 0.1 mN and 0.1 mN·m move a centre of pressure by less. */
const NEAR = 5e-6;

/** The numbers within the vectors' rounding, all else exactly. */
function near(value: unknown, by = NEAR): unknown {
  if (typeof value === 'number')
    return expect.toSatisfy((found) => Math.abs((found as number) - value) <= by);
  if (Array.isArray(value)) return value.map((each) => near(each, by));
  if (typeof value !== 'object' || value === null) return value;
  return Object.fromEntries(
    Object.entries(value).map(([key, each]) => [key, near(each, key === 'force_n' ? 2e-3 : by)]),
  );
}

const cases = readBalanceCases();

it.each(cases)('$name: the balance is what the vectors say', ({ manifest, schema, frames }) => {
  const reader = new BalanceReader(manifest, schema);
  for (const [i, { t, codes, balance }] of frames.entries()) {
    const found = tellBalance(reader.ofFrame(Int32Array.from(codes), t));
    expect(found, `frame ${i}`).toEqual(near(balance));
  }
});

it.each(cases)(
  '$name: a body that is shown has the same balance as its frame',
  ({ manifest, schema, frames }) => {
    const [byBody, byFrame] = [new BalanceReader(manifest, schema), new BalanceReader(manifest, schema)];
    const body = new FrameBody(manifest, schema);
    const linkMatrix = (name: string) => {
      const at = manifest.links.indexOf(name) * 16;
      return { elements: body.worldFromLink.subarray(at, at + 16) };
    };
    for (const { t, codes } of frames) {
      const read = Int32Array.from(codes);
      body.place(read);
      const found = byBody.ofBody({ linkMatrix }, byBody.wrenches(read), t);
      expect(tellBalance(found)).toEqual(tellBalance(byFrame.ofFrame(read, t)));
    }
  },
);
