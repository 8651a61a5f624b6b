import { Decoder, FrameError, parseRelayMessage, type Schema, SchemaError } from '@posecast/wire';

/** The rate that the relay grants a preview, whatever is requested. */
const PREVIEW_HZ = 1;

/**
 * A robot's poses for a preview that moves now and then: one WebSocket at 1 Hz. The relay does not count it as a viewer, and
 * closes it first when it needs the place. It is not reopened, and there is no fallback transport: the preview then stands still.
 * For `url`, see `streamUrl`; `token` is sent first, if there is one.
 */
export class PreviewStream {
  readonly #decoder = new Decoder();
  readonly #socket: WebSocket;
  readonly #onFrame: (schema: Schema, codes: Int32Array) => void;

  constructor(
    url: string,
    token: string | undefined,
    onFrame: (schema: Schema, codes: Int32Array) => void,
    onEnd: () => void,
  ) {
    this.#onFrame = onFrame;
    this.#socket = new WebSocket(`${url}?hz=${PREVIEW_HZ}&preview=1${token ? '&auth=1' : ''}`);
    this.#socket.binaryType = 'arraybuffer';
    this.#socket.onopen = () => {
      if (token) this.#socket.send(JSON.stringify({ type: 'auth', token }));
    };
    this.#socket.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>) => this.#take(data);
    this.#socket.onclose = onEnd;
  }

  close(): void {
    this.#socket.onmessage = this.#socket.onclose = null;
    this.#socket.close();
  }

  #take(data: string | ArrayBuffer): void {
    try {
      if (typeof data !== 'string') {
        const { schema, codes } = this.#decoder.decode(new Uint8Array(data));
        this.#onFrame(schema, codes);
        return;
      }
      const message = parseRelayMessage(data);
      if (message?.type === 'schema') this.#decoder.addSchema(message.text);
    } catch (error) {
      // Unreadable data is skipped, as on the robot's own page, which says why.
      if (!(error instanceof FrameError || error instanceof SchemaError)) throw error;
    }
  }
}
