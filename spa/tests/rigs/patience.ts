import { vi } from 'vitest';

/** What a test waits for may take longer on a busy machine than the second that Vitest waits by default. */
const wait = vi.waitFor;
const LONG_MS = 60_000;
if (wait.name !== 'waitLong') {
  vi.waitFor = function waitLong(probe, options = LONG_MS) {
    return wait(probe, options);
  };
}
