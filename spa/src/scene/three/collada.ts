import { ColladaLoader } from 'three/addons/loaders/ColladaLoader.js';
import type { MeshNote } from '../../model/report.ts';
import { general, quoted } from '../../urdf/finding.ts';
import { MeshError } from '../../urdf/meshes/stl.ts';
import { type LoadedMesh, NO_PICTURES, offline, partsOf } from './loaded_mesh.ts';
import { fan, PolygonCutter } from './polygons.ts';

/** Reads Collada like the edge (posecast_edge.model.meshes.collada), but without pictures: `<unit>` is applied, `<up_axis>` is ignored
 *  as in RViz (vertices are already in the link's frame). three.js reads the rest; it knows only triangles and simple polygons, and
 *  fails without an `<asset>`. */

const POLYGONS = 'polylist, polygons, tristrips, trifans';

/** Reads a file. Rejects with MeshError, or with an error of the loader if the file is broken. */
export function readCollada(text: string): LoadedMesh {
  const notes: MeshNote[] = [];
  const metre = readAsset(text, notes);
  // A name tells a file's own materials from the default of three.js.
  const named = text.replace(/<material\b(?![^>]*\sname=)/g, '<material name="own"');
  const scene = new ColladaLoader(offline()).parse(simplified(named, notes), '')?.scene;
  if (scene === undefined) throw new MeshError('no Collada scene');
  scene.quaternion.identity();
  scene.position.set(0, 0, 0);
  scene.scale.setScalar(metre);
  if (/<texture\s/.test(text)) notes.push(NO_PICTURES);
  return { parts: partsOf(scene, true), notes };
}

/** Reads a file's unit, m, and notes how it and the up axis are treated. */
function readAsset(text: string, notes: MeshNote[]): number {
  const asset = /<asset[\s>].*?<\/asset>/s.exec(text.slice(0, 65_536))?.[0] ?? '';
  const written = (/<unit\b[^>]*\bmeter\s*=\s*["']([^"']*)["']/.exec(asset)?.[1] || '1').trim();
  let metre = Number(written.replace(',', '.') || Number.NaN); // some exporters write a decimal comma
  if (!Number.isFinite(metre) || metre === 0) {
    notes.push(['collada-unit', `its unit ${quoted(written, 20)} is not a number above 0; read as 1 m`]);
    metre = 1;
  }
  if (!(metre > 1e-9 && metre < 1e9)) throw new MeshError(`its unit is ${general(metre)} m`);
  if (metre !== 1) notes.push(['collada-unit', `its unit is ${general(metre)} m; applied`]);
  const axis = (/<up_axis>([^<]*)</.exec(asset)?.[1] ?? '').trim();
  if (axis !== '' && axis !== 'Z_UP')
    notes.push(['collada-axis', `it says ${axis.slice(0, 10)}; ignored, as RViz does`]);
  return metre;
}

/** The file with triangles instead of polygons and strips, and with an `<asset>`. */
function simplified(text: string, notes: MeshNote[]): string {
  if (/<asset[\s>]/.test(text) && !/<(polylist|polygons|tristrips|trifans|skew|lookat)[\s>]/.test(text))
    return text;
  const document = new DOMParser().parseFromString(text, 'text/xml');
  if (document.querySelector('parsererror') !== null || document.documentElement.nodeName !== 'COLLADA')
    throw new MeshError('its XML is broken; export it again');
  if (document.querySelector('asset') === null)
    document.documentElement.prepend(elementLike(document.documentElement, 'asset'));
  for (const tag of ['skew', 'lookat']) {
    if (document.querySelector(`node > ${tag}`) !== null)
      notes.push(['collada-transform', `a <${tag}> in its scene is not applied`]);
  }
  const triangulator = new Triangulator(document, new PolygonCutter(notes));
  for (const element of document.querySelectorAll(POLYGONS)) {
    if (element.parentElement?.nodeName === 'mesh') triangulator.replace(element);
  }
  return new XMLSerializer().serializeToString(document);
}

function elementLike(element: Element, tag: string): Element {
  return element.ownerDocument.createElementNS(element.namespaceURI, tag);
}

/** Replaces the polygons and strips of one file with triangles. */
class Triangulator {
  readonly #ids = new Map<string, Element>();
  readonly #positions = new Map<Element, readonly number[]>();
  readonly #cutter: PolygonCutter;

  constructor(document: Document, cutter: PolygonCutter) {
    this.#cutter = cutter;
    for (const element of document.querySelectorAll('[id]')) {
      const id = `#${element.getAttribute('id')}`;
      if (!this.#ids.has(id)) this.#ids.set(id, element);
    }
  }

  replace(element: Element): void {
    const inputs = childrenOf(element, 'input');
    const offsets = inputs.map((input) => Number(input.getAttribute('offset') ?? 0));
    const stride = Math.max(...offsets, 0) + 1;
    const vertex = inputs.findIndex((input) => input.getAttribute('semantic') === 'VERTEX');
    const corners: number[] = [];
    if (vertex >= 0) {
      const pointOf = this.#pointsOf(inputs[vertex]!);
      const place = offsets[vertex]!;
      for (const rings of polygonsOf(element, stride)) {
        const numbers = rings.flat();
        const points = rings.map((ring) => ring.map((corner) => pointOf(corner[place]!)));
        for (const corner of this.#cut(element.nodeName, points)) corners.push(...numbers[corner]!);
      }
    }
    const made = elementLike(element, 'triangles');
    made.setAttribute('count', String(corners.length / stride / 3));
    const material = element.getAttribute('material');
    if (material !== null) made.setAttribute('material', material);
    made.append(...inputs);
    const list = elementLike(element, 'p');
    list.textContent = corners.join(' ');
    made.append(list);
    element.replaceWith(made);
  }

  #cut(tag: string, rings: readonly (readonly Point[])[]): readonly number[] {
    const [outline] = rings;
    if (tag === 'trifans') return fan(outline!.length);
    if (tag === 'tristrips')
      return fan(outline!.length).map((_, i) => {
        const first = Math.floor(i / 3);
        return first + (first % 2 === 0 || i % 3 === 2 ? i % 3 : 1 - (i % 3));
      });
    return rings.length === 1
      ? this.#cutter.cut(outline!)
      : (this.#cutter.cutRings(rings) ?? fan(outline!.length));
  }

  /** Reads the positions that an `<input semantic="VERTEX">` refers to. */
  #pointsOf(input: Element): (vertex: number) => Point {
    const vertices = this.#ids.get(input.getAttribute('source') ?? '');
    const position = childrenOf(vertices, 'input').find((one) => one.getAttribute('semantic') === 'POSITION');
    const source = this.#ids.get(position?.getAttribute('source') ?? '');
    const array = childrenOf(source, 'float_array')[0];
    const accessor = childrenOf(childrenOf(source, 'technique_common')[0], 'accessor')[0];
    if (array === undefined) throw new MeshError('vertices without numbers');
    let numbers = this.#positions.get(array);
    if (numbers === undefined) {
      numbers = numbersIn(array);
      this.#positions.set(array, numbers);
    }
    const stride = Number(accessor?.getAttribute('stride') ?? 3);
    const values = numbers;
    return (vertex) => {
      const [x, y, z] = values.slice(vertex * stride, vertex * stride + 3);
      if (x === undefined || y === undefined || z === undefined)
        throw new MeshError('a triangle refers to a vertex that does not exist');
      return [x, y, z];
    };
  }
}

type Point = readonly [number, number, number];

function childrenOf(element: Element | undefined, tag: string): Element[] {
  return [...(element?.children ?? [])].filter(({ nodeName }) => nodeName === tag);
}

/** The polygons of an element: of each its rings, of each their corners, with one number for each input. */
function polygonsOf(element: Element, stride: number): number[][][][] {
  const split = (list: Element) => {
    const numbers = numbersIn(list);
    if (numbers.length % stride !== 0) throw new MeshError('a list of corners ends within a corner');
    return Array.from({ length: numbers.length / stride }, (_, i) =>
      numbers.slice(i * stride, (i + 1) * stride),
    );
  };
  const lists = childrenOf(element, 'p').map(split);
  const holed = childrenOf(element, 'ph').map((one) =>
    [...childrenOf(one, 'p'), ...childrenOf(one, 'h')].map(split),
  );
  if (element.nodeName !== 'polylist') return [...lists.map((list) => [list]), ...holed];
  const corners = lists.flat();
  let end = 0;
  const polygons = numbersIn(childrenOf(element, 'vcount')[0]).map((count) => {
    end += count;
    return [corners.slice(end - count, end)];
  });
  if (end > corners.length) throw new MeshError('polygons with more corners than the list has');
  return polygons;
}

/** The numbers in an element. */
function numbersIn(element: Element | undefined): number[] {
  const numbers = (element?.textContent ?? '').split(/\s+/).filter(Boolean).map(Number);
  if (numbers.some(Number.isNaN)) throw new MeshError('a list with something other than numbers');
  return numbers;
}
