/** An X display without a screen: Firefox and WebKitGTK draw WebGL only where there is one. */

import { Process } from '../process.ts';

export interface Display {
  /** What a browser must find in its environment. */
  readonly env: Readonly<Record<string, string>>;
  close(): Promise<void>;
}

export async function openDisplay(): Promise<Display> {
  // Xvfb itself looks for a free number and says which; no TCP, and nothing is reset when a browser leaves
  const args = ['-displayfd', '1', '-screen', '0', '1920x1400x24', '-nolisten', 'tcp', '-noreset'];
  const server = new Process('Xvfb', 'Xvfb', args, { group: true });
  const [number] = await server.line(/^\d+$/);
  return {
    env: { DISPLAY: `:${number}`, LIBGL_ALWAYS_SOFTWARE: '1' },
    close: async () => void (await server.stop()),
  };
}
