const UNITS = ['kB', 'MB', 'GB'] as const;

/** "840 kB", "3.4 MB", "120 MB"; kB = 1000 bytes. */
export function bytesWords(bytes: number): string {
  let size = Math.max(1, bytes) / 1000;
  let unit = 0;
  while (size >= 999.5 && unit < UNITS.length - 1) {
    size /= 1000;
    unit += 1;
  }
  return `${size < 9.95 ? Math.max(0.1, size).toFixed(1) : Math.round(size)} ${UNITS[unit]}`;
}
