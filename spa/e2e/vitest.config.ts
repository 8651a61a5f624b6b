import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vitest/config';

// Most of a test is waiting, so several files run side by side: each process has a browser for its files.
export default defineConfig({
  test: {
    root: fileURLToPath(new URL('.', import.meta.url)),
    include: ['**/*.test.ts'],
    environment: 'node',
    pool: 'forks',
    maxWorkers: 4,
    isolate: false,
    testTimeout: 400_000,
    hookTimeout: 200_000,
    sequence: { concurrent: false },
  },
});
