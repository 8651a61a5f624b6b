/** Loads the 3D view and the styles of its labels. The page itself starts without them. */
export async function loadThree() {
  const [scene] = await Promise.all([import('../../three/index.ts'), import('../styles/signs.css')]);
  return scene;
}
