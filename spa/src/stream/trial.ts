/** A relay tells a status right after its hello. Who says more before is none. */
const HEARD_MAX = 10;

/** Tries a WebSocket beside the stream that runs. `token`: is sent first. `accepted` is called when the relay has let it in, with
 *  what it has said so far. */
export function tryWebSocket(
  url: string,
  token: string | undefined,
  accepted: (socket: WebSocket, heard: readonly MessageEvent<string | ArrayBuffer>[]) => void,
): WebSocket {
  const tried = new WebSocket(url);
  tried.binaryType = 'arraybuffer';
  const heard: MessageEvent<string | ArrayBuffer>[] = [];
  if (token) tried.onopen = () => tried.send(JSON.stringify({ type: 'auth', token }));
  tried.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
    if (heard.push(event) > HEARD_MAX) tried.close();
    else if (isStatus(event.data)) accepted(tried, heard);
  };
  return tried;
}

/** A relay that refuses says no status. */
function isStatus(data: string | ArrayBuffer): boolean {
  try {
    return typeof data === 'string' && JSON.parse(data).type === 'status';
  } catch {
    return false;
  }
}
