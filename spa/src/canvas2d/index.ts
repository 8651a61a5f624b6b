/** The body without WebGL: a canvas, a depth buffer and no three.js. Loaded on demand, where the 3D view can't be. */
export { LightView } from './view.ts';
