/** The 3D view: plain three.js, no framework. Loaded on demand; the rest of the page works without it. */
import { painted as onScreen } from './painted.ts';
import { RobotScene } from './robot_scene.ts';

export type { Pose } from '../twin/pose.ts';
export type { ViewName } from './camera.ts';
export type { ScenePart } from './part.ts';
export type { ModelReport } from './report.ts';
export type { LinkLook } from './skin.ts';
export type { Trouble } from './stamina.ts';
export type { SceneTheme, ThemeName } from './theme.ts';
export type {
  BodyView,
  EyePlace,
  FollowMode,
  LineMember,
  LineView,
  MouseStyle,
  PoseSource,
  SignedBody,
} from './view.ts';

export { RobotScene };

/** What makes a scene, when what the page has drawn so far is on the screen. */
export const painted = () => onScreen().then(() => RobotScene);
