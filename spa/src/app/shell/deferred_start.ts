/** Starts something when its chunk has loaded: `code` resolves to the function that starts it, which returns the function
 *  that stops it. If loading fails, nothing is started. Returns a function that stops it, or keeps it from starting. */
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
