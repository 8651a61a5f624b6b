import type { BodyView } from '../../scene/figure/body_view.ts';
import { isOld } from '../../twin/liveness.ts';
import { Player } from '../../twin/playback/player.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { onSettings, settings } from '../state/settings.ts';

/** Shows the robot's poses in a view as they arrive, outside React. The view is grey while the robot is, or was, STALE or
 *  OFFLINE. Returns a function that stops it. */
export function bindBody(
  scene: Pick<BodyView, 'play' | 'wake' | 'setGrey' | 'lockHeading'>,
  { twin, watch, nowMs, resting }: RobotLink,
): () => void {
  let player: Player | null = null;
  let playedSchema = twin.schema;
  let continuous: readonly string[] = [];

  let raw = false;

  const smooth = (played: Player) => {
    const before = raw;
    raw = !settings().smooth || resting();
    played.raw = raw;
    return raw !== before;
  };
  const take = () => {
    const { schema, state } = twin;
    if (schema === null || state === null) return;
    if (player === null || schema !== playedSchema) {
      player = new Player(schema);
      player.setContinuous(continuous);
      playedSchema = schema;
    }
    const otherwise = smooth(player);
    if (player.push(state) || otherwise) scene.wake();
  };
  const chosen = () => {
    if (player !== null) smooth(player);
    scene.lockHeading(settings().headingLocked);
    scene.wake();
  };
  const grey = () => scene.setGrey(isOld(watch.verdict()));
  scene.play({
    sample: () => {
      if (player === null) return false;
      smooth(player); // the shown time may have stopped meanwhile
      return player.sample(nowMs());
    },
    pose: () => player?.pose(settings().shown) ?? null,
    setContinuous: (joints) => {
      continuous = joints;
      player?.setContinuous(joints);
    },
  });
  const leave = [twin.onState(take), onSettings(chosen), watch.onWord(grey)];
  grey();
  chosen();
  take();
  return () => {
    scene.play(null);
    for (const off of leave) off();
  };
}
