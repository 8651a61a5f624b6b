import { chromium } from 'playwright-core';
const base = process.argv[2];
const out = '/tmp/shots';
const pages = process.argv.slice(3);
const browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'] });
for (const [w, h, dpr] of [[390, 844, 2], [1440, 900, 1]]) for (const scheme of ['light', 'dark']) {
  const ctx = await browser.newContext({ viewport: { width: w, height: h }, deviceScaleFactor: dpr, colorScheme: scheme });
  const page = await ctx.newPage();
  page.on('console', (m) => { if (['error', 'warning'].includes(m.type())) console.log('CONSOLE', m.text()); });
  page.on('pageerror', (e) => console.log('ERR', e.message));
  page.on('request', (r) => { if (!r.url().startsWith(base.startsWith('file') ? 'file:' : base) && !r.url().startsWith('data:')) console.log('OUT', r.url()); });
  for (const p of pages) {
    await page.goto(base + p); await page.waitForTimeout(400);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    if (wide > 0) console.log('WIDE', p, w, wide);
    await page.screenshot({ path: `${out}/${p.replace(/[/#]/g, '_').replace('.html', '')}-${w}-${scheme}.png` });
  }
  await ctx.close();
}
await browser.close();
