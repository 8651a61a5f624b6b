import './styles/sheet.css';
import { type PointerEvent, type ReactNode, useRef, useState } from 'react';
import { say } from '../text/language.ts';
import { heightPx, nextHeight, restingHeight, type SheetHeight } from './sheet_heights.ts';

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
 *  tap on the handle chooses the next height. */
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
        aria-label={height === 'full' ? say().lowerNumbers : say().raiseNumbers}
        aria-expanded={height !== 'peek'}
        onPointerDown={down}
        onPointerMove={move}
        onPointerUp={up}
        onPointerCancel={up}
        onClick={click}
      >
        <i />
      </button>
      {children}
    </div>
  );
}
