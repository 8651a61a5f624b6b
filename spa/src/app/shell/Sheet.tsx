import { type PointerEvent, type ReactNode, useRef, useState } from 'react';
import { say } from '../text/language.ts';

/** The heights of the sheet with the numbers on a phone: `peek` is `PEEK_PX`, `half` somewhat less than half of the available
 *  height, `full` all of it. */
export type SheetHeight = 'peek' | 'half' | 'full';

/** The height of a sheet at `peek`, CSS px. */
export const PEEK_PX = 60;
const HALF = 0.42;
/** On a low screen, half shows at least the tabs and a row. */
const HALF_LEAST_PX = 168;
/** At a speed above this, CSS px per ms, the direction of the drag decides the height, not where it ended. */
const FLICK = 0.5;

const ORDER: readonly SheetHeight[] = ['peek', 'half', 'full'];
const HEIGHT_WORDS = { peek: 'numbersPeek', half: 'numbersHalf', full: 'numbersFull' } as const;

/** A height in CSS px, where `roomPx` is available. */
export function heightPx(height: SheetHeight, roomPx: number): number {
  if (height === 'peek') return Math.min(PEEK_PX, roomPx);
  return height === 'half' ? Math.min(roomPx, Math.max(HALF_LEAST_PX, Math.round(roomPx * HALF))) : roomPx;
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

/** The height that a key on the handle chooses; null for keys that choose none. */
function heightByKey(key: string, height: SheetHeight): SheetHeight | null {
  const at = ORDER.indexOf(height);
  if (key === 'ArrowUp') return ORDER[Math.min(ORDER.length - 1, at + 1)]!;
  if (key === 'ArrowDown') return ORDER[Math.max(0, at - 1)]!;
  return key === 'Home' ? 'full' : key === 'End' ? 'peek' : null;
}

/** A pointer that moves no farther than this, CSS px, counts as a tap. */
const TAP_PX = 6;

interface Drag {
  startY: number;
  startPx: number;
  lastY: number;
  lastMs: number;
  speed: number;
  moved: boolean;
}

/** The sheet over the body that holds the numbers on a phone. Dragging its handle moves it to one of three heights; a
 *  tap on the handle chooses the next height, arrow keys the next higher or lower one. */
export function Sheet({
  height,
  roomPx,
  onHeight,
  children,
}: {
  height: SheetHeight;
  /** The height of the sheet when it is fully open, CSS px. */
  roomPx: number;
  onHeight: (height: SheetHeight) => void;
  children: ReactNode;
}) {
  const drag = useRef<Drag | null>(null);
  const [draggedPx, setDraggedPx] = useState<number | null>(null);
  const px = draggedPx ?? heightPx(height, roomPx);

  const down = (event: PointerEvent<HTMLButtonElement>) => {
    event.currentTarget.setPointerCapture(event.pointerId);
    const y = event.clientY;
    drag.current = { startY: y, startPx: px, lastY: y, lastMs: event.timeStamp, speed: 0, moved: false };
  };
  const move = (event: PointerEvent) => {
    const now = drag.current;
    if (now === null) return;
    const passedMs = event.timeStamp - now.lastMs;
    if (passedMs > 0) now.speed = (now.lastY - event.clientY) / passedMs;
    now.lastY = event.clientY;
    now.lastMs = event.timeStamp;
    now.moved ||= Math.abs(event.clientY - now.startY) > TAP_PX;
    if (now.moved) setDraggedPx(Math.max(40, Math.min(roomPx, now.startPx + now.startY - event.clientY)));
  };
  const up = () => {
    const now = drag.current;
    if (now?.moved && draggedPx !== null) onHeight(restingHeight(draggedPx, now.speed, roomPx));
    setDraggedPx(null);
  };
  const click = () => {
    const moved = drag.current?.moved ?? false; // a drag ends in a click too
    drag.current = null;
    if (!moved) onHeight(nextHeight(height));
  };

  return (
    <div
      className="sheet"
      data-height={height}
      data-dragging={draggedPx !== null}
      data-testid="sheet"
      style={{ height: `${px}px` }}
    >
      <button
        type="button"
        className="grip"
        aria-label={say()[HEIGHT_WORDS[height]]}
        aria-expanded={height !== 'peek'}
        onPointerDown={down}
        onPointerMove={move}
        onPointerUp={up}
        onPointerCancel={up}
        onClick={click}
        onKeyDown={(event) => {
          const chosen = heightByKey(event.key, height);
          if (chosen === null) return;
          event.preventDefault();
          onHeight(chosen);
        }}
      >
        <i />
      </button>
      {children}
    </div>
  );
}
