/** An X display without a screen: Firefox and WebKitGTK need one for WebGL. */

import { Process } from '../process.ts';

export interface Display {
  /** The environment for a browser. */
  readonly env: Readonly<Record<string, string>>;
  close(): Promise<void>;
}

export async function openDisplay(): Promise<Display> {
  // Xvfb chooses and reports a free number; no TCP, and no reset when a browser exits
  const args = ['-displayfd', '1', '-screen', '0', '1920x1400x24', '-nolisten', 'tcp', '-noreset'];
  const server = new Process('Xvfb', 'Xvfb', args, { group: true });
  const [number] = await server.line(/^\d+$/);
  return {
    env: { DISPLAY: `:${number}`, LIBGL_ALWAYS_SOFTWARE: '1' },
    close: async () => void (await server.stop()),
  };
}
