/** Loads the 3D view and the styles of its labels, which are chunks of their own. Rejects if they can't be loaded. */
export async function loadThree() {
  const [scene] = await Promise.all([import('../../three/index.ts'), import('../styles/signs.css')]);
  return scene;
}
