/** Starts something as soon as its own chunk is here; where that does not come, the page does without. Returns what stops it,
 *  also before it has started. */
export function startWhenLoaded(code: Promise<() => () => void>): () => void {
  let left = false;
  let end: (() => void) | null = null;
  code.then(
    (begin) => {
      if (!left) end = begin();
    },
    () => {},
  );
  return () => {
    left = true;
    end?.();
  };
}
