import { expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { hasSkin } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

it('the page and its worker load nothing but their own, and make no code from text', async () => {
  const relay = await stage.stack.demo();
  const page = await stage.open(`${relay.url}/#/r/demo`);
  await until('shells, which WebAssembly unpacks', () => hasSkin(page));

  const own = await page.evaluate<string>(
    `document.querySelector('meta[http-equiv="Content-Security-Policy"]').content`,
  );
  const scripts = own.split('; ').find((part) => part.startsWith('script-src'));
  // the hash of the script in the page itself
  expect(scripts).toMatch(/^script-src 'self' 'wasm-unsafe-eval' 'sha256-[\w+/]{43}='$/);
  const worker = page.requested.find((url) => /\/worker-[^/]+\.js$/.test(url));
  for (const url of [relay.url, worker ?? 'no worker was asked for']) {
    const told = url === worker ? own : `${own}; frame-ancestors 'none'`; // which only a header can set
    expect((await fetch(url)).headers.get('content-security-policy'), url).toBe(told);
  }

  const signingIn = page.requested.filter((url) => /\/account-[^/]*\.js|firebase|googleapis/i.test(url));
  expect(signingIn, 'nothing of Firebase where nobody signs in').toEqual([]);

  page.forgive(/polic/i); // blocking it is logged
  // in a separate task of the page: code evaluated by a driver may be exempt
  const made = await page.evaluate<string>(`new Promise((done) => setTimeout(() => {
    try { done(new Function('return "made"')()); } catch (error) { done(error.name); }
  }))`);
  expect(made).toBe('EvalError');
});
