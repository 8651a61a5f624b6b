// @vitest-environment happy-dom
import { createElement } from 'react';
import { createRoot } from 'react-dom/client';
import { afterEach, expect, it, vi } from 'vitest';
import { KeysSheet } from '../../src/app/settings/KeysSheet.tsx';
import { pastControls } from '../../src/app/state/viewing.ts';
import { moreKo } from '../../src/app/text/ko.ts';
import { FakePast } from '../rigs/past_fake.ts';

afterEach(() => {
  pastControls.set(null);
  document.body.replaceChildren();
});

async function keysOf(recorded: object | null): Promise<string> {
  const past = new FakePast(Date.UTC(2026, 10, 22, 14, 30));
  Object.assign(past.playhead, { recorded });
  pastControls.set(past);
  const host = document.body.appendChild(document.createElement('div'));
  const root = createRoot(host);
  root.render(createElement(KeysSheet, { onClose: () => {} }));
  await vi.waitFor(() => expect(document.body.textContent).toContain('Home End'));
  const said = document.body.textContent ?? '';
  root.unmount();
  return said;
}

it('names what leads to live, where there is a present', async () => {
  expect(await keysOf(null)).toMatch(/back to live.*the oldest, live/s);
});

it('says of a recording where it begins and ends, and nothing of live', async () => {
  const said = await keysOf({});
  expect(said).toContain('on the time line: the beginning, the end');
  expect(said).not.toMatch(/\blive\b/);
  expect(moreKo.keyRecordedEnds).not.toContain('실시간');
});
