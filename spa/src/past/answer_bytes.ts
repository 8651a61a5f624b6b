import { PastError } from './past_source.ts';

/** The bytes of an answer. Rejects with a `PastError` ('damaged') as soon as there are more than `most`. `heard` is called for
 *  each chunk received. */
export async function answerBytes(
  { body }: Response,
  name: string,
  most: number,
  heard: () => void = () => {},
): Promise<Uint8Array<ArrayBuffer>> {
  const reader = body?.getReader();
  const pieces: Uint8Array<ArrayBuffer>[] = [];
  let size = 0;
  for (;;) {
    const { value } = (await reader?.read()) ?? {};
    if (value === undefined) break;
    heard();
    size += value.length;
    if (size > most) {
      await reader?.cancel();
      throw new PastError('damaged', `${name}: more than ${most} bytes`);
    }
    pieces.push(value);
  }
  return new Uint8Array(await new Blob(pieces).arrayBuffer());
}
