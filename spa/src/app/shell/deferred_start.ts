/** Begins what has code of its own as soon as that is here; where it does not come, the page does without. Returns the end
 *  of it. */
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
