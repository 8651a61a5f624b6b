/** Loads the 3D view, a chunk of its own. Rejects if it can't be loaded. The styles of its labels come with what has them
 *  drawn, `overlay/overlay_link.ts`. */
export function loadThree() {
  return import('../../three/index.ts');
}
