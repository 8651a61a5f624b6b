import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vitest/config';

// One browser and one stack at a time, because the tests measure time and order.
export default defineConfig({
  test: {
    root: fileURLToPath(new URL('.', import.meta.url)),
    include: ['**/*.test.ts'],
    environment: 'node',
    pool: 'forks',
    fileParallelism: false,
    testTimeout: 180_000,
    hookTimeout: 120_000,
    sequence: { concurrent: false },
  },
});
