// @vitest-environment happy-dom
import { createElement } from 'react';
import { createRoot } from 'react-dom/client';
import { expect, it, vi } from 'vitest';
import { missedMoment, NoPast, useMomentNamed } from '../../src/app/past/PastBelowBody.tsx';

function Page() {
  const why = missedMoment(useMomentNamed(), undefined);
  return why === null ? null : createElement(NoPast, { why });
}

it('says that a link names no moment, until that has been read, also once the address is another', async () => {
  window.location.hash = '#/r/demo?t=hello';
  const host = document.createElement('div');
  const root = createRoot(host);
  root.render(createElement(Page));
  await vi.waitFor(() => expect(host.textContent).toMatch(/moment in this link can’t be read. This is live/));
  window.history.replaceState(null, '', '#/r/demo');
  root.render(createElement(Page));
  await vi.waitFor(() => expect(host.textContent).toMatch(/moment in this link can’t be read/));
  root.unmount();
});
