/** A relay sends a status right after its hello. A server that sends more before it is not a relay. */
const HEARD_MAX = 10;

/** No relay requests a longer wait. */
const WAIT_S_MAX = 86_400;

/** Tries a WebSocket in parallel to the running stream. `token` is sent first. `accepted` is called when the relay has accepted
 *  it, with the messages so far; `refused` if it declines, with the seconds until the next try. */
export function tryWebSocket(
  url: string,
  token: string | undefined,
  accepted: (socket: WebSocket, heard: readonly MessageEvent<string | ArrayBuffer>[]) => void,
  refused: (retryS: number) => void,
): WebSocket {
  const tried = new WebSocket(url);
  tried.binaryType = 'arraybuffer';
  const heard: MessageEvent<string | ArrayBuffer>[] = [];
  if (token) tried.onopen = () => tried.send(JSON.stringify({ type: 'auth', token }));
  tried.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
    const { type, retry_s } = membersOf(event.data);
    if (heard.push(event) > HEARD_MAX) tried.close();
    else if (type === 'status')
      accepted(tried, heard); // a relay that refuses sends no status
    else if (type === 'bye' && typeof retry_s === 'number' && retry_s > 0 && retry_s <= WAIT_S_MAX)
      refused(retry_s);
  };
  return tried;
}

function membersOf(data: string | ArrayBuffer): { readonly type?: unknown; readonly retry_s?: unknown } {
  try {
    return (typeof data === 'string' && JSON.parse(data)) || {};
  } catch {
    return {};
  }
}
