import type { CameraRig } from '../camera/camera_rig.ts';
import type { Fingers } from '../figure/body_view.ts';

/** Relative change of the distance per pixel of wheel scrolling. */
const ZOOM_PER_PIXEL = 0.0012;

/** Handles pointers on a canvas: one finger or the left button turns, two fingers or any other button pan, pinch and wheel zoom
 *  towards where they point. `setFingers`: see `BodyView`; `stop` ends it. */
export function attachPointerInput(
  canvas: HTMLCanvasElement,
  eye: CameraRig,
): { setFingers: (fingers: Fingers) => void; stop: () => void } {
  let all = true;
  const fingers = new Map<number, { x: number; y: number }>();
  const leave = new AbortController();
  const { signal } = leave;
  const place = (event: MouseEvent) => {
    const { left, top } = canvas.getBoundingClientRect();
    return { x: event.clientX - left, y: event.clientY - top };
  };
  const lift = (event: PointerEvent) => fingers.delete(event.pointerId);

  canvas.addEventListener(
    'pointerdown',
    (event) => {
      canvas.setPointerCapture(event.pointerId);
      if (fingers.size < 2) fingers.set(event.pointerId, place(event));
    },
    { signal },
  );
  canvas.addEventListener(
    'pointermove',
    (event) => {
      const before = fingers.get(event.pointerId);
      if (before === undefined) return;
      const now = place(event);
      const [dx, dy] = [now.x - before.x, now.y - before.y];
      const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
      fingers.set(event.pointerId, now);
      if (other !== undefined) {
        const gap = (p: { x: number; y: number }) => Math.max(1, Math.hypot(p.x - other.x, p.y - other.y));
        if (all) eye.pan(dx / 2, dy / 2);
        else eye.drag(dx / 2, dy / 2);
        eye.zoom(gap(before) / gap(now), (now.x + other.x) / 2, (now.y + other.y) / 2);
      } else if (event.pointerType === 'mouse' && ((event.buttons & 1) === 0 || event.shiftKey))
        eye.pan(dx, dy);
      else if (all || event.pointerType !== 'touch') eye.drag(dx, dy);
    },
    { signal },
  );
  canvas.addEventListener('pointerup', lift, { signal });
  canvas.addEventListener('pointercancel', lift, { signal });
  canvas.addEventListener('contextmenu', (event) => event.preventDefault(), { signal });
  canvas.addEventListener(
    'wheel',
    (event) => {
      event.preventDefault();
      const pixels = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : 32);
      const { x, y } = place(event);
      eye.zoom(Math.exp(pixels * ZOOM_PER_PIXEL), x, y);
    },
    { signal, passive: false },
  );
  return {
    setFingers: (fingers) => {
      all = fingers === 'all';
      canvas.style.touchAction = all ? 'none' : 'pan-y';
    },
    stop: () => leave.abort(),
  };
}
