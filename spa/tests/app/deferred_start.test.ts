import { expect, it } from 'vitest';
import { startWhenLoaded } from '../../src/app/shell/late.tsx';

/** Code that loads when the test says so. */
function code() {
  const heard: string[] = [];
  let come!: () => void;
  let fail!: () => void;
  const promise = new Promise<() => () => void>((resolve, reject) => {
    come = () =>
      resolve(() => {
        heard.push('begun');
        return () => heard.push('ended');
      });
    fail = () => reject(new Error('no such chunk'));
  });
  const settled = () => new Promise((resolve) => setTimeout(resolve));
  return { promise, heard, come, fail, settled };
}

it('begins when its code is here, and ends when told to', async () => {
  const { promise, heard, come, settled } = code();
  const end = startWhenLoaded(promise);
  come();
  await settled();
  expect(heard).toEqual(['begun']);
  end();
  expect(heard).toEqual(['begun', 'ended']);
});

it('ended before its code is here, it never begins', async () => {
  const { promise, heard, come, settled } = code();
  startWhenLoaded(promise)();
  come();
  await settled();
  expect(heard).toEqual([]);
});

it('code that does not come is nobody’s trouble', async () => {
  const { promise, heard, fail, settled } = code();
  const end = startWhenLoaded(promise);
  fail();
  await settled();
  end();
  expect(heard).toEqual([]);
});
