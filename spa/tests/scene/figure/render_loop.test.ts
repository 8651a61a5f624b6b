import { expect, it } from 'vitest';
import { RenderLoop } from '../../../src/scene/figure/render_loop.ts';

/** A screen whose repaints are triggered by the test. */
class Screen {
  readonly waiting: ((nowMs: number) => void)[] = [];
  pictures = 0;
  nowMs = 0;
  readonly loop = new RenderLoop(
    () => {
      this.pictures += 1;
      return true;
    },
    (tick) => this.waiting.push(tick),
  );

  repaint(afterMs = 16): void {
    this.nowMs += afterMs;
    for (const tick of this.waiting.splice(0)) tick(this.nowMs);
  }
}

it('draws once for many changes, and nothing while nothing changes', () => {
  const screen = new Screen();
  screen.loop.request();
  screen.loop.request();
  expect(screen.waiting.length).toBe(1);
  screen.repaint();
  expect([screen.pictures, screen.loop.renderedFrames]).toEqual([1, 1]);
  expect(screen.waiting.length).toBe(0);
});

it('goes on while something moves, and a pause is not counted as movement', () => {
  const screen = new Screen();
  const steps: number[] = [];
  const leave = screen.loop.add({
    advance: (seconds) => {
      steps.push(seconds);
      screen.loop.request();
      return steps.length < 3;
    },
  });
  screen.loop.wake();
  screen.repaint(60_000);
  screen.repaint();
  screen.repaint();
  expect(steps).toEqual([0.1, 0.016, 0.016]);
  expect(screen.pictures).toBe(3);
  screen.repaint(); // the change in the last step was drawn with it
  expect(screen.waiting.length).toBe(0);
  leave();
  screen.loop.wake();
  screen.repaint();
  expect([steps.length, screen.pictures]).toEqual([3, 3]);
});

it('asks without drawing when what was woken has not changed', () => {
  const screen = new Screen();
  screen.loop.add({ advance: () => false });
  screen.loop.wake();
  screen.repaint();
  expect([screen.loop.ticks, screen.pictures]).toEqual([1, 0]);
});

it('does not count a picture that could not be made, and nothing once it is stopped', () => {
  let lost = true;
  const loop = new RenderLoop(
    () => !lost,
    () => {},
  );
  loop.drawNow();
  expect(loop.renderedFrames).toBe(0);
  lost = false;
  loop.drawNow();
  loop.stop();
  loop.drawNow();
  expect(loop.renderedFrames).toBe(1);
});

it('measures repaints in motion, not the pauses between two motions', () => {
  const screen = new Screen();
  const intervals: number[] = [];
  screen.loop.onInterval = (ms) => intervals.push(ms);
  let left = 3;
  screen.loop.add({
    advance: () => {
      screen.loop.request();
      left -= 1;
      return left > 0;
    },
  });
  screen.loop.wake();
  for (let i = 0; i < 5; i += 1) screen.repaint(40);
  left = 2;
  screen.loop.wake();
  screen.repaint(5000);
  screen.repaint(20);
  expect(intervals).toEqual([40, 40, 20]);
});
