import '../styles/divider.css';
import { type KeyboardEvent, type PointerEvent, useRef } from 'react';
import { say } from '../text/language.ts';

const STEP_PX = 24;

/** The line between body and panel: dragged or moved by arrow keys; where it stands is remembered. */
export function Divider({
  widthPx,
  onWidth,
}: {
  /** Of the panel, which lies to the right. */
  widthPx: number;
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
