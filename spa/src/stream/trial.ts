/** A relay tells a status right after its hello. Who says more before is none. */
const HEARD_MAX = 10;

/** What the worker lends to a trial. */
export interface TrialPorts {
  /** Whether a message is a status, which no refusal has. */
  isStatus(data: string | ArrayBuffer): boolean;
  /** The relay has let it in; it has said this so far. */
  accepted(socket: WebSocket, heard: readonly MessageEvent<string | ArrayBuffer>[]): void;
}

/** Tries a WebSocket beside the stream that runs. `token`: is sent first. */
export function tryWebSocket(
  url: string,
  token: string | undefined,
  { isStatus, accepted }: TrialPorts,
): WebSocket {
  const tried = new WebSocket(url);
  tried.binaryType = 'arraybuffer';
  const heard: MessageEvent<string | ArrayBuffer>[] = [];
  if (token) tried.onopen = () => tried.send(JSON.stringify({ type: 'auth', token }));
  tried.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
    if (heard.push(event) > HEARD_MAX) tried.close();
    if (isStatus(event.data)) accepted(tried, heard);
  };
  return tried;
}
