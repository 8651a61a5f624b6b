import { type KeyboardEvent, type PointerEvent, useRef } from 'react';
import { say } from '../text/language.ts';

const STEP_PX = 24;

/** The divider between the body and the panel at its right. Dragging it or the left and right arrow keys call
 *  `onWidth`. */
export function Divider({
  widthPx,
  onWidth,
}: {
  /** The width of the panel, CSS px. */
  widthPx: number;
  /** Called with the new panel width, CSS px, not limited to what fits; `done` is false while the divider is dragged. */
  onWidth: (widthPx: number, done: boolean) => void;
}) {
  const start = useRef<{ x: number; widthPx: number } | null>(null);

  const down = (event: PointerEvent<HTMLDivElement>) => {
    event.currentTarget.setPointerCapture(event.pointerId);
    start.current = { x: event.clientX, widthPx };
  };
  const move = (event: PointerEvent, done: boolean) => {
    if (start.current === null) return;
    onWidth(start.current.widthPx - (event.clientX - start.current.x), done);
    if (done) start.current = null;
  };
  const key = (event: KeyboardEvent) => {
    const step = event.key === 'ArrowLeft' ? STEP_PX : event.key === 'ArrowRight' ? -STEP_PX : 0;
    if (step !== 0) onWidth(widthPx + step, true);
  };

  return (
    // biome-ignore lint/a11y/useSemanticElements: an <hr> can't be dragged in every browser
    <div
      className="divider"
      role="separator"
      aria-orientation="vertical"
      aria-label={say().widthOfNumbers}
      aria-valuenow={Math.round(widthPx)}
      tabIndex={0}
      onPointerDown={down}
      onPointerMove={(event) => move(event, false)}
      onPointerUp={(event) => move(event, true)}
      onPointerCancel={() => {
        start.current = null;
      }}
      onKeyDown={key}
    />
  );
}
