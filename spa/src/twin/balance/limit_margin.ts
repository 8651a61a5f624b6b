/** The remaining range of a joint. */
export interface LimitMargin {
  /** To the nearer limit, rad or m; negative beyond it. */
  readonly left: number;
  readonly nearer: 'lower' | 'upper';
  /** The same as a fraction of half the range: 1 in the middle, 0 at a limit, negative beyond it. */
  readonly part: number;
}

/** The distance of a joint (rad or m) from its nearer limit. null without a reading, for a joint without limits, and if they
 *  leave no range, as in URDF's `lower="0" upper="0"`. */
export function limitMargin(
  value: number | null,
  limits: { readonly lower: number; readonly upper: number } | null,
): LimitMargin | null {
  if (value === null || !Number.isFinite(value) || limits === null || !(limits.upper > limits.lower))
    return null;
  const [below, above] = [value - limits.lower, limits.upper - value];
  const left = Math.min(below, above);
  const part = left / ((limits.upper - limits.lower) / 2);
  return { left, nearer: below <= above ? 'lower' : 'upper', part };
}
