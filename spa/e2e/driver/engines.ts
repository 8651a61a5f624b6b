/** The engine in which a test run takes place: `POSECAST_ENGINE`, else Chromium. */

import { openChromium } from './chromium.ts';
import { openFirefox } from './firefox.ts';
import type { Browser, BrowserOptions, EngineName } from './page.ts';
import { openWebKitGtk } from './webkitgtk.ts';

const OPEN: Readonly<Record<EngineName, (options?: BrowserOptions) => Promise<Browser>>> = {
  chromium: openChromium,
  firefox: openFirefox,
  webkitgtk: openWebKitGtk,
};

export function engineName(): EngineName {
  const name = process.env.POSECAST_ENGINE ?? 'chromium';
  if (!Object.hasOwn(OPEN, name)) {
    throw new Error(`POSECAST_ENGINE is ${name}; it may be ${Object.keys(OPEN).join(', ')}`);
  }
  return name as EngineName;
}

export function openBrowser(options?: BrowserOptions): Promise<Browser> {
  return OPEN[engineName()](options);
}

let kept: { readonly kind: string; readonly browser: Promise<Browser> } | null = null;

/** The browser of the file before, if it was opened with these options, or a new one: to start one takes longer than most tests. It
 *  ends with this process. */
export async function keepBrowser(options: BrowserOptions = {}): Promise<Browser> {
  const kind = JSON.stringify(options);
  if (kept?.kind !== kind) {
    await (await kept?.browser)?.close();
    kept = { kind, browser: openBrowser(options) };
  }
  return kept.browser;
}
