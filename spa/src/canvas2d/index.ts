/** The light view: the body without WebGL and three.js, rasterised on a 2D canvas. Loaded on demand. */
export { LightView } from './view.ts';
