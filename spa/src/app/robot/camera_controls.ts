import type { BodyView } from '../../scene/figure/body_view.ts';
import { onTaps } from '../../scene/figure/taps.ts';
import type { KinematicTree } from '../../twin/kinematic_tree.ts';
import { JointChannels } from '../../twin/kinematic_tree.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { pressedLabel, watchPresses } from '../explain/pressed_sign.ts';
import { addPageKeys, type KeyHandlers } from '../shell/page_keys.ts';
import { isGuest } from '../state/address.ts';
import { onSettings, settings } from '../state/settings.ts';
import { onSelection, selection, selectJoint } from '../state/viewing.ts';
import { more, onLanguage } from '../text/language.ts';
import { shareGestures } from './guest_gestures.ts';

/** How far one key press turns, moves and zooms the camera. */
const TURN_RAD = Math.PI / 24;
const PAN_PX = 40;
const NEARER = 0.85;

/** What covers the picture: at its top, and at its bottom. */
const NOTES = '.stage-note, .stage-views, .stage-level';
const BUTTONS = '.stage-tools, .stage-foot';
/** Gap between a note and the robot, CSS px. */
const AIR = 4;

type Eye = Pick<BodyView, 'look' | 'focus' | 'orbit' | 'pan' | 'zoom' | 'pick'>;

/** What the camera's keys do. `middle`: the middle of the body's element in the window, CSS px. */
export function cameraKeys(view: Eye, middle: () => { x: number; y: number }): KeyHandlers {
  return {
    turn: ({ key }) => {
      const { x, y } = directionOf(key);
      view.orbit(x * TURN_RAD, y * TURN_RAD);
    },
    pan: ({ key }) => {
      const { x, y } = directionOf(key);
      view.pan(x * PAN_PX, y * PAN_PX);
    },
    nearer: () => view.zoom(NEARER),
    farther: () => view.zoom(1 / NEARER),
    home: () => view.look('home'),
    front: () => view.look('front'),
    side: () => view.look('side'),
    top: () => view.look('top'),
    closeUp: () => closeTo(view, middle()),
  };
}

function directionOf(arrow: string): { x: number; y: number } {
  return {
    x: Number(arrow === 'ArrowLeft') - Number(arrow === 'ArrowRight'),
    y: Number(arrow === 'ArrowUp') - Number(arrow === 'ArrowDown'),
  };
}

/** Moves close to the link at a point of the window (CSS px), or back to the home view if there is no link. */
export function closeTo(view: Pick<Eye, 'pick' | 'focus' | 'look'>, at: { x: number; y: number }): void {
  const link = view.pick(at.x, at.y);
  if (link === null) view.look('home');
  else view.focus(link);
}

/** Attaches keys and double taps to the body's element, and follows the setting how the camera follows a walking robot. Returns a function that detaches them. */
export function attachCameraControls(element: HTMLElement, view: BodyView): () => void {
  const chosen = () => view.setFollow(settings().follow);
  const middle = () => {
    const { left, top, width, height } = element.getBoundingClientRect();
    return { x: left + width / 2, y: top + height / 2 };
  };
  // for screen readers, because a canvas has no text
  const named = () => element.querySelector('canvas')?.setAttribute('aria-label', more().viewOfRobot);
  chosen();
  named();
  const leave = [
    addPageKeys(() => cameraKeys(view, middle), element),
    onLanguage(named),
    onSettings(chosen),
    onTaps(element, (x, y, times) => times === 2 && closeTo(view, { x, y })),
    markTurning(element),
  ];
  if (isGuest()) leave.push(shareGestures(element, view));
  return () => {
    for (const off of leave) off();
  };
}

/** Marks the stage (`data-turning`) while a finger moves on the body: what lies over it then steps back. */
function markTurning(element: HTMLElement): () => void {
  const leave = new AbortController();
  const { signal } = leave;
  const stage = element.parentElement;
  const fingers = new Set<number>();
  const down = ({ pointerId, pointerType }: PointerEvent) =>
    pointerType === 'touch' && fingers.add(pointerId);
  const move = ({ pointerId, movementX, movementY }: PointerEvent) => {
    if (fingers.has(pointerId) && (movementX !== 0 || movementY !== 0))
      stage?.setAttribute('data-turning', '');
  };
  const up = ({ pointerId }: PointerEvent) => {
    fingers.delete(pointerId);
    if (fingers.size === 0) stage?.removeAttribute('data-turning');
  };
  element.addEventListener('pointerdown', down, { signal });
  element.addEventListener('pointermove', move, { signal });
  for (const end of ['pointerup', 'pointercancel'] as const) element.addEventListener(end, up, { signal });
  return () => leave.abort();
}

/** Tells a view how much of the picture is covered by notes and buttons, so that they don't hide the robot's feet or head.
 *  Returns a function that stops it. */
export function bindInsets(canvas: HTMLElement, view: Pick<BodyView, 'setCover'>): () => void {
  const stage = canvas.parentElement;
  if (stage === null) return () => {};
  const measure = () => {
    const { left, top, bottom, width } = stage.getBoundingClientRect();
    // Hidden elements have no size and cover nothing; nor does what stands in a corner, beside the robot.
    const over = (selector: string) =>
      [...stage.querySelectorAll(`:scope > :is(${selector})`)]
        .map((each) => each.getBoundingClientRect())
        .filter((at) => at.height > 0 && at.right > left + width / 4 && at.left < left + (3 * width) / 4);
    view.setCover({
      above: Math.max(0, ...over(NOTES).map((at) => at.bottom - top + AIR)),
      below: Math.max(0, ...over(BUTTONS).map((at) => bottom - at.top)),
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

type Looked = Pick<BodyView, 'pick' | 'visit' | 'goBack' | 'setLinkLook'>;

/**
 * Connects body and numbers: tapping a link selects its joint, and the selected joint's link is highlighted. Selecting a joint in
 * the table also moves the camera to its link; clearing the selection moves it back. Returns a function that stops it.
 */
export function bindSelection(element: HTMLElement, view: Looked, twin: RobotTwin): () => void {
  let lit: readonly string[] = [];
  let channels: { schema: RobotTwin['schema']; of: JointChannels } | null = null;

  const channelsNow = (): JointChannels | null => {
    const { schema } = twin;
    if (schema === null) return null;
    if (channels?.schema !== schema) channels = { schema, of: new JointChannels(schema) };
    return channels.of;
  };
  const light = () => {
    const joint = selection()?.joint ?? null;
    const { tree } = twin;
    const moved = joint === null ? [] : (channelsNow()?.jointsOf(joint) ?? []);
    const links = tree === null ? [] : moved.flatMap((name) => tree.bodyOf(name));
    if (links.join('\n') === lit.join('\n')) return;
    for (const link of lit) if (!links.includes(link)) view.setLinkLook(link, {});
    for (const link of links) if (!lit.includes(link)) view.setLinkLook(link, { highlight: 1 });
    lit = links;
  };
  const bring = () => {
    light();
    const chosen = selection();
    if (chosen?.from !== 'numbers') return;
    const joints = channelsNow()?.jointsOf(chosen.joint) ?? [];
    const link = joints.map((joint) => twin.tree?.linkOf(joint)).find((found) => found != null);
    if (link != null) view.visit(link);
  };
  const leave = () => {
    light();
    view.goBack();
  };
  const tap = (x: number, y: number, times: 1 | 2) => {
    // a tap on an overlay sign asks for its explanation
    const link = times === 1 && pressedLabel({ x, y }) === null ? view.pick(x, y) : null;
    const channel = link === null ? null : channelOf(link, twin.tree, channelsNow());
    if (channel !== null) selectJoint(channel, 'body');
  };

  const ends = [
    watchPresses((x, y) => view.pick(x, y) !== null),
    onTaps(element, tap),
    onSelection(() => (selection() === null ? leave() : bring())),
    twin.onChange(light),
  ];
  bring();
  return () => {
    for (const end of ends) end();
    for (const link of lit) view.setLinkLook(link, {});
  };
}

/** The label of the channel whose joint moves a link, or of the nearest such channel towards the root; null if there is
 *  none. */
export function channelOf(
  link: string,
  tree: KinematicTree | null,
  channels: JointChannels | null,
): string | null {
  let joint = tree?.jointOf(link) ?? null;
  while (joint !== null) {
    const channel = channels?.channelOf(joint) ?? null;
    if (channel !== null) return channel;
    joint = tree?.before(joint) ?? null;
  }
  return null;
}
