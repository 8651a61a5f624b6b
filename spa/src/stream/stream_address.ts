import type { Transport } from './transport.ts';

/** The address to connect to for a rate. `url`: the stream's own; for events the token goes in a header, and for segments none is
 *  sent. */
export function streamAddress(url: string, by: Transport, hz: number, hasToken: boolean): string {
  if (by === 'mirror') return url;
  if (by === 'events') return `${url.replace(/^ws/, 'http')}.sse?hz=${hz}`;
  return `${url}?hz=${hz}${hasToken ? '&auth=1' : ''}`;
}

/** The address that answers with the clock of the relay that sends the stream at `url`. */
export function pingAddress(url: string): string {
  return new URL('../../ping', url.replace(/^ws/, 'http')).href;
}
