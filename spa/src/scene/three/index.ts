/** The 3D view in plain three.js, without a framework. Loaded on demand; the rest of the page works without it. */
import { afterNextPaint } from '../../browser/painting.ts';
import { RobotScene } from './scene.ts';

export { RobotScene };

/** Resolves to the scene's class once what the page has drawn so far is on the screen. */
export const painted = () => afterNextPaint().then(() => RobotScene);
