/** The three heights of the phone's sheet, as parts of the room under the top bar (peek is fixed, in px). */
export type SheetHeight = 'peek' | 'half' | 'full';

export const PEEK_PX = 60;
const HALF = 0.52;
/** Faster than this, a flick decides and not where the finger let go (px per ms). */
const FLICK = 0.5;

const ORDER: readonly SheetHeight[] = ['peek', 'half', 'full'];

export function heightPx(height: SheetHeight, roomPx: number): number {
  if (height === 'peek') return Math.min(PEEK_PX, roomPx);
  return height === 'half' ? Math.round(roomPx * HALF) : roomPx;
}

/** Where a sheet that was let go comes to rest. `speed`: px per ms, positive upwards. */
export function restingHeight(px: number, speed: number, roomPx: number): SheetHeight {
  const distance = (height: SheetHeight) => Math.abs(heightPx(height, roomPx) - px);
  if (speed > FLICK) return ORDER.find((height) => heightPx(height, roomPx) > px) ?? 'full';
  if (speed < -FLICK) return ORDER.findLast((height) => heightPx(height, roomPx) < px) ?? 'peek';
  return ORDER.reduce((best, height) => (distance(height) < distance(best) ? height : best));
}

/** What a tap on the handle does. */
export function nextHeight(height: SheetHeight): SheetHeight {
  return height === 'peek' ? 'half' : height === 'half' ? 'full' : 'peek';
}
