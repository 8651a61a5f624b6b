/** A rectangle, CSS px from the picture's upper left corner. */
export interface LabelBox {
  readonly left: number;
  readonly top: number;
  readonly width: number;
  readonly height: number;
}

/** Space between a label and what is above it, CSS px. */
const AIR = 4;

/** Places labels near their `wished` positions: moved down just far enough that they overlap neither `taken` nor each other, and
 *  within a picture of this width. */
export function placeApart(
  wished: readonly LabelBox[],
  taken: readonly LabelBox[],
  width: number,
): LabelBox[] {
  const placed: LabelBox[] = [];
  for (const wish of wished) {
    const left = Math.max(0, Math.min(wish.left, width - wish.width));
    const inTheWay = [...taken, ...placed].filter(
      (other) => other.left < left + wish.width && left < other.left + other.width,
    );
    let top = Math.max(0, wish.top);
    // from top to bottom: moving a label down past one obstacle may bring it to the next
    for (const other of inTheWay.sort((a, b) => a.top - b.top)) {
      if (other.top < top + wish.height && top < other.top + other.height)
        top = other.top + other.height + AIR;
    }
    placed.push({ ...wish, left, top });
  }
  return placed;
}
