import { CameraRig } from '../../src/scene/camera/camera_rig.ts';
import type { FloorView } from '../../src/scene/canvas2d/floor.ts';
import { paintStrokes } from '../../src/scene/canvas2d/overlay_painter.ts';
import type { Strokes } from '../../src/scene/signs/strokes.ts';

/** The fills and strokes in order: colour, and the points of the path. */
function recorder() {
  const done: { how: 'fill' | 'stroke'; color: string; points: [number, number][]; width: number }[] = [];
  let points: [number, number][] = [];
  const context = {
    fillStyle: '',
    strokeStyle: '',
    lineWidth: 1,
    beginPath: () => {
      points = [];
    },
    closePath: () => {},
    moveTo: (x: number, y: number) => points.push([x, y]),
    lineTo: (x: number, y: number) => points.push([x, y]),
    ellipse: (x: number, y: number) => points.push([x, y]),
    fill: () => done.push({ how: 'fill', color: context.fillStyle, points, width: 0 }),
    stroke: () => done.push({ how: 'stroke', color: context.strokeStyle, points, width: context.lineWidth }),
  };
  return { context: context as unknown as CanvasRenderingContext2D, done };
}

function sight(): FloorView {
  const eye = new CameraRig();
  eye.resize(400, 300);
  eye.frame([-0.3, -0.3, 0], [0.3, 0.3, 1.2], false);
  eye.look('front', false);
  const { reach } = eye;
  return { screenFromWorld: eye.screenFromWorld(), width: 400, height: 300, reach, fade: reach, x: 0, y: 0 };
}

/** What the light view paints of strokes, seen from the front. */
export function paintedStrokes(strokes: Strokes, over = true) {
  const { context, done } = recorder();
  paintStrokes(context, sight(), 1, strokes, over);
  return done;
}
