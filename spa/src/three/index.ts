/** The 3D view: plain three.js, no framework. Loaded on demand; the rest of the page works without it. */
import { afterNextPaint } from '../browser/next_paint.ts';
import { RobotScene } from './scene.ts';

export { RobotScene };

/** What makes a scene, when what the page has drawn so far is on the screen. */
export const painted = () => afterNextPaint().then(() => RobotScene);
