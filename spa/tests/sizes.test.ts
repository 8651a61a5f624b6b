import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';
import { describe, expect, it } from 'vitest';

/** The download sizes for a visitor. kB = 1000 bytes, gzip -9. The list and the table must work without the scene. */
const ENTRY_LIMIT_KB = 125;
const NUMBERS_LIMIT_KB = 135;
const SCENE_LIMIT_KB = 193;
/** The page, its worker and the scene: everything before a body in 3D. */
const FIRST_3D_VIEW_LIMIT_KB = 317;
const LIGHT_LIMIT_KB = 38;
const PAST_LIMIT_KB = 26;
/** Draws the time line, and the dialog for going to a moment: loaded once there is a line, or on demand. */
const LINE_PART_LIMIT_KB = 7;
const MOMENTS_LIMIT_KB = 5;
const INCIDENTS_LIMIT_KB = 4;
/** Reads segments, once somebody looks back. */
const PAST_READER_LIMIT_KB = 4;
/** Reads segments as a stream, with a separate decoder, and the index for earlier events. */
const LANE_LIMIT_KB = 15;
/** Saves the past: the dialog, and the file writers (of which @mcap/core is 15 kB and fflate 7). */
const SAVE_SHEET_LIMIT_KB = 7;
const SAVE_LIMIT_KB = 50;

/** Computes, draws and describes balance, with its style sheet: everything loaded when it is switched on. Excludes what a page
 *  with a body has anyway, including the sentences of all late parts (0.6 kB of them about balance). */
const BALANCE_LIMIT_KB = 12;
/** The table and the traces of its numbers, and the limits of a selected joint. */
const BALANCE_EXTRAS_LIMIT_KB = 1.5;

const dist = fileURLToPath(new URL('../dist/', import.meta.url));
const built = existsSync(`${dist}.vite/manifest.json`);

interface Chunk {
  file: string;
  isEntry?: boolean;
  imports?: string[];
  dynamicImports?: string[];
  css?: string[];
}

const READER = 'src/past/relay/past_reader.ts';
const kb = (file: string) => gzipSync(readFileSync(`${dist}${file}`), { level: 9 }).length / 1000;

describe.skipIf(!built)('bundle (skipped when spa/dist is not built)', () => {
  const chunks = (): Record<string, Chunk> => JSON.parse(readFileSync(`${dist}.vite/manifest.json`, 'utf8'));

  /** A chunk with all it imports at once. */
  const filesOf = (all: Record<string, Chunk>, name: string, seen = new Set<string>()): Set<string> => {
    const chunk = all[name];
    if (chunk === undefined || seen.has(chunk.file)) return seen;
    seen.add(chunk.file);
    for (const css of chunk.css ?? []) seen.add(css);
    for (const next of chunk.imports ?? []) filesOf(all, next, seen);
    return seen;
  };

  /** The chunks of the time line, and of playing the past. */
  const timeLineOf = (all: Record<string, Chunk>): string =>
    Object.keys(all).find((name) => all[name]?.dynamicImports?.includes(READER)) ?? '';

  it('the page comes in 125 kB, its worker included, and with the table in 135, without the scene', () => {
    const all = chunks();
    const entry = Object.keys(all).find((name) => all[name]?.isEntry);
    const worker = readdirSync(`${dist}assets`).filter((file) => /^worker-.*\.js$/.test(file));
    expect(worker.length).toBe(1);
    const files = [...filesOf(all, entry ?? ''), ...worker.map((file) => `assets/${file}`)];
    const panel = 'src/app/numbers/Panel.tsx';
    expect(all[entry ?? '']?.dynamicImports).toContain(panel);
    const numbers = [...filesOf(all, panel)].filter((file) => !files.includes(file));
    const sumOf = (names: string[]) => {
      const sizes = names.map((file) => [file, kb(file)] as const);
      console.info(sizes.map(([file, size]) => `${file}: ${size.toFixed(1)} kB`).join('\n'));
      return sizes.reduce((sum, [, size]) => sum + size, 0);
    };
    const page = sumOf(files);
    expect(page).toBeLessThan(ENTRY_LIMIT_KB);
    expect(page + sumOf(numbers)).toBeLessThan(NUMBERS_LIMIT_KB);
    for (const file of [...files, ...numbers])
      expect(readFileSync(`${dist}${file}`, 'utf8')).not.toContain('WebGLRenderer');
  });

  it('who reads in the lane gets 15 kB more, in one file that imports nothing', () => {
    const lane = readdirSync(`${dist}assets`).filter((file) => /^lane_script-.*\.js$/.test(file));
    expect(lane.length).toBe(1);
    console.info(`${lane[0]}: ${kb(`assets/${lane[0]}`).toFixed(1)} kB`);
    expect(kb(`assets/${lane[0]}`)).toBeLessThan(LANE_LIMIT_KB);
    expect(readFileSync(`${dist}assets/${lane[0]}`, 'utf8')).not.toMatch(/\bimport\b/);
  });

  it('nothing imports from the worker: WebKit would run it a second time, beside the first', () => {
    const assets = readdirSync(`${dist}assets`).filter((file) => file.endsWith('.js'));
    expect(
      assets.filter((file) =>
        /(from|import)\s*["']\.\/worker-/.test(readFileSync(`${dist}assets/${file}`, 'utf8')),
      ),
    ).toEqual([]);
  });

  it('the list comes in less, without worker or scene', () => {
    const all = chunks();
    const files = [...filesOf(all, 'index.html'), ...filesOf(all, 'src/app/pages/list/RobotList.tsx')];
    const sum = [...new Set(files)].reduce((sizes, file) => sizes + kb(file), 0);
    console.info(`the list: ${sum.toFixed(1)} kB`);
    expect(files).toContain(all['src/app/pages/list/RobotList.tsx']?.file);
    expect(sum).toBeLessThan(ENTRY_LIMIT_KB);
  });

  it('the scene is asked for on demand, in 193 kB, and with the page and its worker in 317', () => {
    const all = chunks();
    const scene = Object.keys(all).find((name) => name.endsWith('src/three/index.ts'));
    const entry = Object.keys(all).find((name) => all[name]?.isEntry);
    expect(all[entry ?? '']?.dynamicImports).toContain(scene);
    const shared = filesOf(all, entry ?? '');
    const files = [...filesOf(all, scene ?? '')].filter((file) => !shared.has(file));
    const sizes = files.map((file) => [file, kb(file)] as const);
    console.info(sizes.map(([file, size]) => `${file}: ${size.toFixed(1)} kB`).join('\n'));
    const sum = sizes.reduce((all, [, size]) => all + size, 0);
    expect(sum).toBeLessThan(SCENE_LIMIT_KB);
    const worker = readdirSync(`${dist}assets`).filter((file) => /^worker-.*\.js$/.test(file));
    const before = [...shared, ...worker.map((file) => `assets/${file}`)];
    const first = before.reduce((all, file) => all + kb(file), sum);
    console.info(`the first 3D view: ${first.toFixed(1)} kB`);
    expect(first).toBeLessThan(FIRST_3D_VIEW_LIMIT_KB);
  });

  it('the light view comes alone, in 38 kB and without any three.js', () => {
    const all = chunks();
    const light = Object.keys(all).find((name) => name.endsWith('src/canvas2d/index.ts'));
    const entry = Object.keys(all).find((name) => all[name]?.isEntry);
    expect(all[entry ?? '']?.dynamicImports).toContain(light);
    const shared = filesOf(all, entry ?? '');
    const files = [...filesOf(all, light ?? '')].filter((file) => !shared.has(file));
    const sizes = files.map((file) => [file, kb(file)] as const);
    console.info(sizes.map(([file, size]) => `${file}: ${size.toFixed(1)} kB`).join('\n'));
    expect(sizes.reduce((sum, [, size]) => sum + size, 0)).toBeLessThan(LIGHT_LIMIT_KB);
    for (const file of files)
      expect(readFileSync(`${dist}${file}`, 'utf8')).not.toMatch(/WebGLRenderer|three\.core/);
  });

  it('the time line comes where there is a past, in 26 kB, and its parts by themselves, in 4 to 7', () => {
    const all = chunks();
    const entry = Object.keys(all).find((name) => all[name]?.isEntry) ?? '';
    const shared = filesOf(all, entry);
    const line = timeLineOf(all);
    const sizeOf = (name: string, had: ReadonlySet<string> = shared) => {
      const files = [...filesOf(all, name)].filter(
        (file) => (/past|key_page/i.test(file) || had !== shared) && !shared.has(file) && !had.has(file),
      );
      expect(files).toContain(all[name]?.file);
      const sizes = files.map((file) => [file, kb(file)] as const);
      console.info(sizes.map(([file, size]) => `${file}: ${size.toFixed(1)} kB`).join('\n'));
      return sizes.reduce((sum, [, size]) => sum + size, 0);
    };
    expect(sizeOf(line)).toBeLessThan(PAST_LIMIT_KB);
    expect(all[line]?.dynamicImports).toContain(READER);
    expect(sizeOf(READER)).toBeLessThan(PAST_READER_LIMIT_KB);
    const panel = [...filesOf(all, 'src/app/numbers/Panel.tsx'), ...filesOf(all, line)];
    const had = new Set([...shared, ...panel]);
    const folder = 'src/app/past/time_line';
    expect(sizeOf(`${folder}/line_part.ts`, had)).toBeLessThan(LINE_PART_LIMIT_KB);
    expect(sizeOf(`${folder}/jump/MomentSheet.tsx`, had)).toBeLessThan(MOMENTS_LIMIT_KB);
    expect(sizeOf(`${folder}/incidents/Incidents.tsx`, had)).toBeLessThan(INCIDENTS_LIMIT_KB);
  });

  it('saving comes to nobody who does not save, its sheet in 7 kB, what writes the files in 50', () => {
    const all = chunks();
    const entry = Object.keys(all).find((name) => all[name]?.isEntry) ?? '';
    const line = filesOf(all, timeLineOf(all));
    expect(line.size).toBeGreaterThan(0);
    const first = filesOf(all, entry);
    const shared = new Set([...first, ...line]);
    const [sheet, save] = ['src/app/past/save/SaveSheet.tsx', 'src/past/save/save.ts'];
    const sizeOf = (name: string) => {
      const files = [...filesOf(all, name)].filter((file) => !shared.has(file));
      expect(files).toContain(all[name]?.file);
      const sizes = files.map((file) => [file, kb(file)] as const);
      console.info(sizes.map(([file, size]) => `${file}: ${size.toFixed(1)} kB`).join('\n'));
      return sizes.reduce((sum, [, size]) => sum + size, 0);
    };
    expect(sizeOf(sheet)).toBeLessThan(SAVE_SHEET_LIMIT_KB);
    expect(all[sheet]?.dynamicImports).toContain(save);
    expect(sizeOf(save)).toBeLessThan(SAVE_LIMIT_KB);
    expect(filesOf(all, save), 'it comes where a model can be had').not.toContain(
      all['src/app/balance/balance_part.ts']?.imports?.map((name) => all[name]?.file)[0],
    );
    for (const file of line)
      if (!first.has(file))
        expect(readFileSync(`${dist}${file}`, 'utf8')).not.toMatch(/ros2msg|posecast-recording/);
  });

  it('balance comes to nobody who does not watch it, in 12 kB, its numbers and a joint’s limits by themselves', () => {
    const all = chunks();
    const entry = Object.keys(all).find((name) => all[name]?.isEntry) ?? '';
    const part = 'src/app/balance/balance_part.ts';
    const scene = Object.keys(all).find((name) => name.endsWith('src/three/index.ts')) ?? '';
    // Chunks that any page with a robot and its numbers has; a file shared by two of its parts does not count.
    const had = new Set<string>();
    const before = [entry, scene, READER, 'src/app/numbers/Panel.tsx', 'src/app/status/Announcer.tsx'];
    const links = Object.keys(all).filter((name) =>
      /body_(link|parts)|overlay_link|own_alarms|mapping_parser/.test(name),
    );
    for (const name of [...before, ...links]) filesOf(all, name, had);
    const sizeOf = (name: string, more: ReadonlySet<string> = new Set()) => {
      const files = [...filesOf(all, name)].filter((file) => !had.has(file) && !more.has(file));
      expect(files).toContain(all[name]?.file);
      const sizes = files.map((file) => [file, kb(file)] as const);
      console.info(sizes.map(([file, size]) => `${file}: ${size.toFixed(2)} kB`).join('\n'));
      return sizes.reduce((sum, [, size]) => sum + size, 0);
    };
    expect(sizeOf(part)).toBeLessThan(BALANCE_LIMIT_KB);
    const balance = filesOf(all, part);
    for (const name of ['src/app/balance/balance_numbers.ts', 'src/view/joint_limits.ts'])
      expect(sizeOf(name, balance)).toBeLessThan(BALANCE_EXTRAS_LIMIT_KB);
  });

  it('signing in comes to nobody who does not sign in, in 40 kB', () => {
    const all = chunks();
    const entry = Object.keys(all).find((name) => all[name]?.isEntry) ?? '';
    const account = all['src/auth/account.ts']?.file ?? 'no such chunk';
    const early = [...filesOf(all, entry), ...filesOf(all, 'src/app/pages/list/RobotList.tsx')];
    expect(early).not.toContain(account);
    expect(readFileSync(`${dist}${account}`, 'utf8')).toContain('identitytoolkit');
    for (const file of early)
      expect(readFileSync(`${dist}${file}`, 'utf8')).not.toContain('signInWithPassword');
    expect(kb(account)).toBeLessThan(40);
  });
});
