/** The 3D view: plain three.js, no framework. Loaded on demand; the rest of the page works without it. */
import { painted as onScreen } from '../browser/next_paint.ts';
import { RobotScene } from './scene.ts';

export type { LinkLook } from '../model/posed_body.ts';
export type { ModelReport } from '../model/report.ts';
export type { Pose } from '../twin/playback/pose.ts';
export type { Trouble } from '../view/adaptive_quality.ts';
export type {
  BodyView,
  EyePlace,
  FollowMode,
  LineMember,
  LineView,
  MouseStyle,
  PoseSource,
  SignedBody,
} from '../view/body_view.ts';
export type { ViewName } from './camera.ts';
export type { ScenePart } from './scene_part.ts';
export type { SceneTheme, ThemeName } from './theme.ts';

export { RobotScene };

/** What makes a scene, when what the page has drawn so far is on the screen. */
export const painted = () => onScreen().then(() => RobotScene);
