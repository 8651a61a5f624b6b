/** The heights of the sheet with the numbers on a phone: `peek` is `PEEK_PX`, `half` about half of the available height,
 *  `full` all of it. */
export type SheetHeight = 'peek' | 'half' | 'full';

/** The height of a sheet at `peek`, CSS px. */
export const PEEK_PX = 60;
const HALF = 0.485;
/** At a speed above this, CSS px per ms, the direction of the drag decides the height, not where it ended. */
const FLICK = 0.5;

const ORDER: readonly SheetHeight[] = ['peek', 'half', 'full'];

/** A height in CSS px, where `roomPx` is available. */
export function heightPx(height: SheetHeight, roomPx: number): number {
  if (height === 'peek') return Math.min(PEEK_PX, roomPx);
  return height === 'half' ? Math.round(roomPx * HALF) : roomPx;
}

/** The height that a sheet takes when a drag ends. `px`: its height at that moment; `speed`: CSS px per ms, positive
 *  upwards; `roomPx`: the available height. */
export function restingHeight(px: number, speed: number, roomPx: number): SheetHeight {
  const distance = (height: SheetHeight) => Math.abs(heightPx(height, roomPx) - px);
  if (speed > FLICK) return ORDER.find((height) => heightPx(height, roomPx) > px) ?? 'full';
  if (speed < -FLICK) return ORDER.findLast((height) => heightPx(height, roomPx) < px) ?? 'peek';
  return ORDER.reduce((best, height) => (distance(height) < distance(best) ? height : best));
}

/** The height that a tap on the handle chooses: peek, half, full, and peek again. */
export function nextHeight(height: SheetHeight): SheetHeight {
  return height === 'peek' ? 'half' : height === 'half' ? 'full' : 'peek';
}
