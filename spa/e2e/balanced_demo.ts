/** The demo's model with masses and soles. */

import { cpSync, readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { DEMO } from './sign_words.ts';

type Triple = [number, number, number];
interface Raw {
  links: string[];
  visuals: { link: number; box?: [Triple, Triple] }[];
  inertials?: unknown;
  soles?: unknown;
}

/** kg per m³ of what the boxes of its links enclose: 43 kg of robot. */
const DENSITY = 900;
const SOLED = ['Body_LAR', 'Body_RAR'];

/** Writes the demo's model into a folder, each link as heavy as its box. */
export function writeBalanced(folder: string): string {
  cpSync(DEMO.model, folder, { recursive: true });
  const file = path.join(folder, 'manifest.json');
  const manifest = JSON.parse(readFileSync(file, 'utf8')) as Raw;
  const boxes = new Map<number, [Triple, Triple]>();
  for (const { link, box } of manifest.visuals) {
    if (box === undefined) continue;
    const [min, max] = boxes.get(link) ?? box;
    boxes.set(link, [
      min.map((one, i) => Math.min(one, box[0][i]!)) as Triple,
      max.map((one, i) => Math.max(one, box[1][i]!)) as Triple,
    ]);
  }
  manifest.inertials = [...boxes]
    .sort(([a], [b]) => a - b)
    .map(([link, [min, max]]) => {
      const [x, y, z] = max.map((one, i) => one - min[i]!) as Triple;
      const mass_kg = DENSITY * x * y * z;
      const about = (a: number, b: number) => (mass_kg * (a * a + b * b)) / 12;
      const inertia = [about(y, z), 0, 0, about(x, z), 0, about(x, y)];
      return { link, mass_kg, xyz: min.map((one, i) => (one + max[i]!) / 2), inertia };
    });
  manifest.soles = SOLED.map((name) => {
    const link = manifest.links.indexOf(name);
    const [[x0, y0, z], [x1, y1]] = boxes.get(link)!;
    const points = [
      [x0, y0, z],
      [x1, y0, z],
      [x1, y1, z],
      [x0, y1, z],
    ];
    return { link, points };
  });
  writeFileSync(file, JSON.stringify(manifest));
  return folder;
}
