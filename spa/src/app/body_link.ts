import type { RobotScene } from '../scene/index.ts';
import { Poser } from '../twin/pose.ts';
import type { RobotLink } from './robot_link.ts';
import { onSettings, settings } from './settings.ts';

/** Lets the body follow the twin, outside React. Returns the end of it. */
export function bodyFollows(scene: RobotScene, { twin, watch }: RobotLink): () => void {
  let poser: Poser | null = null;
  let made = '';

  const live = () => watch.word === 'LIVE' || watch.word === 'HOLDING';
  const pose = () => {
    const { schema, state } = twin;
    if (schema === null || state === null) return;
    const { shown } = settings();
    const wanted = `${schema.id} ${shown}`;
    if (poser === null || wanted !== made) {
      poser = new Poser(schema, schema.field(shown) === null ? 'pos' : shown);
      made = wanted;
    }
    scene.setPose(poser.pose(state.codes), live());
  };
  const grey = () => {
    scene.setGrey(!live());
    pose();
  };
  const leave = [twin.onState(pose), onSettings(pose), watch.onWord(grey)];
  grey();
  return () => {
    for (const off of leave) off();
  };
}
