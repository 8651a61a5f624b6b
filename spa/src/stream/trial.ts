/** A relay tells a status right after its hello. Who says more before is none. */
const HEARD_MAX = 10;

/** A wait of more is none of a relay's. */
const WAIT_S_MAX = 86_400;

/** Tries a WebSocket beside the stream that runs. `token`: is sent first. `accepted` is called when the relay has let it in, with
 *  what it has said so far; `refused` when it says that it does not, and after how many seconds it may be tried again. */
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
      accepted(tried, heard); // a relay that refuses says none
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
