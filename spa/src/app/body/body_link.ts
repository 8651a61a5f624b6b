import { Player } from '../../twin/playback/player.ts';
import type { BodyView } from '../../view/body_view.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { onSettings, settings } from '../state/settings.ts';

/** Shows the robot's poses in a view as they arrive, outside React. The view is grey unless the robot is LIVE or HOLDING.
 *  Returns a function that stops it. */
export function bindBody(
  scene: Pick<BodyView, 'play' | 'wake' | 'setGrey'>,
  { twin, watch }: RobotLink,
): () => void {
  let player: Player | null = null;
  let playedSchema = twin.schema;
  let continuous: readonly string[] = [];

  const live = () => watch.word === 'LIVE' || watch.word === 'HOLDING';
  const take = () => {
    const { schema, state } = twin;
    if (schema === null || state === null) return;
    if (player === null || schema !== playedSchema) {
      player = new Player(schema);
      player.raw = !settings().smooth;
      player.setContinuous(continuous);
      playedSchema = schema;
    }
    if (player.push(state)) scene.wake();
  };
  const chosen = () => {
    if (player !== null) player.raw = !settings().smooth;
    scene.wake();
  };
  const grey = () => scene.setGrey(!live());
  scene.play({
    sample: (nowMs) => player?.sample(nowMs) ?? false,
    pose: () => player?.pose(settings().shown) ?? null,
    setContinuous: (joints) => {
      continuous = joints;
      player?.setContinuous(joints);
    },
  });
  const leave = [twin.onState(take), onSettings(chosen), watch.onWord(grey)];
  grey();
  take();
  return () => {
    scene.play(null);
    for (const off of leave) off();
  };
}
