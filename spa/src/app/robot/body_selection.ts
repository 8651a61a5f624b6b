import type { BodyView } from '../../scene/figure/body_view.ts';
import { onTaps } from '../../scene/figure/taps.ts';
import { JointChannels, type KinematicTree } from '../../twin/kinematic_tree.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { pressedLabel, watchPresses } from '../explain/pressed_sign.ts';
import { onSelection, selection, selectJoint } from '../state/selection.ts';

type Eye = Pick<BodyView, 'pick' | 'visit' | 'goBack' | 'setLinkLook'>;

/**
 * Connects body and numbers: tapping a link selects its joint, and the selected joint's link is highlighted. Selecting a joint in
 * the table also moves the camera to its link; clearing the selection moves it back. Returns a function that stops it.
 */
export function bindSelection(element: HTMLElement, view: Eye, twin: RobotTwin): () => void {
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
