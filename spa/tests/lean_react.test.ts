import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import { expect, it } from 'vitest';
import { sharedAlone } from '../lean_react/plugin.ts';

const require = createRequire(import.meta.url);
const folder = path.dirname(require.resolve('react-dom'));
const read = (file: string) => readFileSync(path.join(folder, `cjs/${file}.production.js`), 'utf8');
const [DOM, CLIENT] = [read('react-dom'), read('react-dom-client')];

function exportsOf(text: string): Record<string, unknown> {
  const exports = {};
  new Function('exports', text)(exports);
  return exports;
}

it('what is left of react-dom is the object that its client shares with it', () => {
  const [[name, lean], ...more] = Object.entries(exportsOf(sharedAlone(DOM, CLIENT))) as [[string, object]];
  expect(more).toEqual([]);
  const whole = (require(path.join(folder, 'cjs/react-dom.production.js')) as Record<string, object>)[name]!;
  const shapeOf = (value: unknown): unknown =>
    typeof value === 'object' && value !== null
      ? Object.entries(value).map(([key, member]) => [key, shapeOf(member)])
      : typeof value === 'function'
        ? 'function'
        : value;
  expect(shapeOf(lean)).toEqual(shapeOf(whole));
  expect(CLIENT).toContain(`ReactDOM.${name}`);
});

it('refuses a client that uses more of it, and a react-dom of another shape', () => {
  expect(() => sharedAlone(DOM, `${CLIENT}\nReactDOM.createPortal();`)).toThrow('lean_react/plugin.ts');
  expect(() => sharedAlone(DOM.replace('Internals = {', 'Others = {'), CLIENT)).toThrow(
    'lean_react/plugin.ts',
  );
});
