/** Small mesh files for tests, each with one particular feature. */

const CUBE_FACES = [
  [0, 2, 1],
  [0, 3, 2],
  [4, 5, 6],
  [4, 6, 7],
  [0, 1, 5],
  [0, 5, 4],
  [1, 2, 6],
  [1, 6, 5],
  [2, 3, 7],
  [2, 7, 6],
  [3, 0, 4],
  [3, 4, 7],
] as const;

/** A unit cube around the origin: 12 faces, 9 numbers each, normals outwards. */
export function cubeSoup(): Float32Array {
  const corner = (i: number) => [
    i === 1 || i === 2 || i === 5 || i === 6 ? 0.5 : -0.5,
    i % 4 >= 2 ? 0.5 : -0.5,
    i >= 4 ? 0.5 : -0.5,
  ];
  return Float32Array.from(CUBE_FACES.flatMap((face) => face.flatMap(corner)));
}

export function binaryStl(soup: Float32Array, header = 'made for a test'): Uint8Array {
  const faces = soup.length / 9;
  const bytes = new Uint8Array(84 + faces * 50);
  bytes.set(new TextEncoder().encode(header).subarray(0, 80));
  const view = new DataView(bytes.buffer);
  view.setUint32(80, faces, true);
  soup.forEach((value, i) => {
    view.setFloat32(84 + Math.floor(i / 9) * 50 + 12 + (i % 9) * 4, value, true);
  });
  return bytes;
}

export function asciiStl(soup: Float32Array): Uint8Array {
  let text = 'solid cube\n';
  for (let at = 0; at < soup.length; at += 9) {
    text += ' facet normal 0 0 0\n  outer loop\n';
    for (let c = 0; c < 9; c += 3)
      text += `   vertex ${soup[at + c]} ${soup[at + c + 1]} ${soup[at + c + 2]}\n`;
    text += '  endloop\n endfacet\n';
  }
  return new TextEncoder().encode(`${text}endsolid cube\n`);
}

/** One triangle in Collada, in centimetres, in a file that claims to be Y-up, fully transparent. */
export function collada(transparency = '0.0', up = 'Y_UP'): Uint8Array {
  return new TextEncoder().encode(`<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><unit name="centimeter" meter="0.01"/><up_axis>${up}</up_axis></asset>
 <library_effects><effect id="e"><profile_COMMON><technique sid="common"><lambert>
  <diffuse><color>1 0 0 1</color></diffuse>
  <transparent><color>1 1 1 1</color></transparent><transparency><float>${transparency}</float></transparency>
 </lambert></technique></profile_COMMON></effect></library_effects>
 <library_materials><material id="m" name="red"><instance_effect url="#e"/></material></library_materials>
 <library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array id="a" count="9">0 0 0 100 0 0 0 0 100</float_array>
   <technique_common><accessor source="#a" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="1" material="s"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
 </mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="scene"><node id="n"><instance_geometry url="#g"><bind_material><technique_common>
  <instance_material symbol="s" target="#m"/></technique_common></bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
 <scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>`);
}

/** Two triangles: one red, one with a paint that its library does not define. */
export const OBJ = `mtllib paints.mtl
v 0 0 0
v 1 0 0
v 0 0 1
v 0 1 0
usemtl red
f 1 2 3
usemtl bare
f 1 2 4
`;
export const MTL = 'newmtl red\nKd 1 0 0\nmap_Kd picture.png\n';

/** One triangle in a binary glTF, its node 1 m along x. */
export function triangleGlb(color: readonly number[] | null = [0, 0, 1, 1]): Uint8Array {
  const corners = Float32Array.of(0, 0, 0, 1, 0, 0, 0, 1, 0);
  const materials =
    color === null ? [] : [{ name: 'blue', pbrMetallicRoughness: { baseColorFactor: color } }];
  const json = JSON.stringify({
    asset: { version: '2.0' },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0, translation: [1, 0, 0] }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, ...(color === null ? {} : { material: 0 }) }] }],
    materials,
    accessors: [
      { bufferView: 0, componentType: 5126, count: 3, type: 'VEC3', min: [0, 0, 0], max: [1, 1, 0] },
    ],
    bufferViews: [{ buffer: 0, byteLength: corners.byteLength }],
    buffers: [{ byteLength: corners.byteLength }],
  });
  const text = new TextEncoder().encode(json.padEnd(Math.ceil(json.length / 4) * 4));
  const bytes = new Uint8Array(12 + 8 + text.length + 8 + corners.byteLength);
  const view = new DataView(bytes.buffer);
  const head = [0x46546c67, 2, bytes.length, text.length, 0x4e4f534a];
  for (const [i, value] of head.entries()) view.setUint32(4 * i, value, true);
  bytes.set(text, 20);
  view.setUint32(20 + text.length, corners.byteLength, true);
  view.setUint32(24 + text.length, 0x004e4942, true);
  bytes.set(new Uint8Array(corners.buffer), 28 + text.length);
  return bytes;
}
