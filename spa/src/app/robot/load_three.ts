/** Loads the 3D view, a separate chunk. Rejects if it can't be loaded. The label styles come with the code that draws labels,
 *  `sign_link.ts`. */
export function loadThree() {
  return import('../../scene/three/index.ts');
}
