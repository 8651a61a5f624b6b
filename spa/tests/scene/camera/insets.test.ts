import { describe, expect, it } from 'vitest';
import { ViewInsets } from '../../../src/scene/camera/insets.ts';

function area(): ViewInsets {
  const made = new ViewInsets();
  made.resize(400, 300);
  return made;
}

describe('the free part of a picture', () => {
  it('lies between what stands over its edges', () => {
    const made = area();
    expect([made.top, made.free, made.aspect]).toEqual([0, 300, 400 / 300]);
    expect(made.setInsets({ above: 40, below: 60 }, false)).toBe(true);
    expect([made.top, made.free, made.aspect]).toEqual([40, 200, 2]);
    expect(made.setInsets({ above: 40, below: 60 }, false)).toBe(false);
  });

  it('goes there gently, and knows at once how wide it will be', () => {
    const made = area();
    made.setInsets({ above: 40, below: 60 }, true);
    expect([made.moving, made.top, made.aspect]).toEqual([true, 0, 2]);
    let before = 0;
    for (let i = 0; i < 5; i += 1) {
      made.advance(0.05);
      expect(made.top).toBeGreaterThan(before);
      before = made.top;
    }
    expect([made.moving, made.top, made.free]).toEqual([false, 40, 200]);
  });

  it('turns round half way without a jump', () => {
    const made = area();
    made.setInsets({ above: 60, below: 0 }, true);
    made.advance(0.1);
    const { top } = made;
    made.setInsets({ above: 0, below: 0 }, true);
    expect(made.top).toBeCloseTo(top, 9);
  });

  it('keeps three fifths of the height, whatever stands over it', () => {
    const made = area();
    made.setInsets({ above: 300, below: 300 }, false);
    expect([made.top, made.free]).toEqual([60, 180]);
  });
});
