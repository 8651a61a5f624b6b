/** The 3D view and the styles of what it writes beside the body; the page itself starts without either. */
export async function loadThree() {
  const [scene] = await Promise.all([import('../../three/index.ts'), import('../styles/signs.css')]);
  return scene;
}
