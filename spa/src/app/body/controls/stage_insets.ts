import type { BodyView } from '../../../view/body_view.ts';

const NOTES = '.stage-note, .stage-views';
const BUTTONS = '.stage-tools, .stage-foot, .model-findings';
/** Gap between a note and the robot, CSS px. */
const AIR = 4;

/** Tells a view how much of the picture is covered by notes and buttons, so that they don't hide the robot's feet or head.
 *  Returns a function that stops it. */
export function bindInsets(canvas: HTMLElement, view: Pick<BodyView, 'setCover'>): () => void {
  const stage = canvas.parentElement;
  if (stage === null) return () => {};
  const over = (selector: string) =>
    [...stage.querySelectorAll(`:scope > :is(${selector})`)].map((each) => each.getBoundingClientRect());
  const measure = () => {
    const { top, bottom } = stage.getBoundingClientRect();
    // Hidden elements have no size and cover nothing.
    const most = (lengths: readonly number[]) => Math.max(0, ...lengths);
    view.setCover({
      above: most(over(NOTES).map((at) => (at.height > 0 ? at.bottom - top + AIR : 0))),
      below: most(over(BUTTONS).map((at) => (at.height > 0 ? bottom - at.top : 0))),
    });
  };
  const sizes = new ResizeObserver(measure);
  const watch = () => {
    sizes.disconnect();
    for (const each of [stage, ...stage.children]) sizes.observe(each);
    measure();
  };
  const changes = new MutationObserver(watch);
  changes.observe(stage, { childList: true });
  watch();
  return () => {
    sizes.disconnect();
    changes.disconnect();
  };
}
