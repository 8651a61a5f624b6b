// @vitest-environment happy-dom
import { afterEach, expect, it } from 'vitest';
import { bindInsets } from '../../src/app/robot/camera_controls.ts';
import type { Insets } from '../../src/scene/camera/insets.ts';

/** A stage of 300 px; the elements over it by class, with their range below its top edge. */
function stage(parts: Readonly<Record<string, readonly [number, number]>>): HTMLElement {
  document.body.innerHTML = '<section><div class="canvas"></div></section>';
  const section = document.querySelector('section')!;
  const put = (element: Element, top: number, bottom: number) => {
    element.getBoundingClientRect = () => new DOMRect(0, 50 + top, 400, bottom - top);
  };
  put(section, 0, 300);
  for (const [name, [top, bottom]] of Object.entries(parts)) {
    const part = document.createElement('div');
    part.className = name;
    put(part, top, bottom);
    section.append(part);
  }
  return section.querySelector<HTMLElement>('.canvas')!;
}

function coverOf(canvas: HTMLElement): Insets | null {
  let told: Insets | null = null;
  bindInsets(canvas, {
    setCover: (cover) => {
      told = cover;
    },
  })();
  return told;
}

afterEach(() => {
  document.body.innerHTML = '';
});

it('tells how far notes reach down and buttons up', () => {
  const covered = coverOf(
    stage({ 'stage-note': [14, 50], 'stage-views': [54, 90], 'stage-tools': [250, 290] }),
  );
  expect(covered).toEqual({ above: 94, below: 50 });
});

it('what is hidden or empty covers nothing', () => {
  const covered = coverOf(stage({ 'stage-views': [10, 10], 'stage-tools': [-50, -50] }));
  expect(covered).toEqual({ above: 0, below: 0 });
});
