// @vitest-environment happy-dom
import { expect, it } from 'vitest';
import { NameColumn } from '../../src/app/numbers/table/name_column.ts';
import { createElement } from '../../src/app/shell/cells.ts';

const LABELS = ['left_hip_pitch_joint', 'left_hip_roll_joint', 'left_knee_joint'];

/** A table of three columns, the middle one 100 px wide, in this much room. Nothing is measured: a letter is 7 px wide. */
function columnIn(room: { px: number }) {
  const host = createElement('div', '');
  Object.defineProperty(host, 'clientWidth', { get: () => room.px });
  const table = createElement('table', 'joints');
  const head = createElement('thead', '');
  for (const width of [0, 100, 0]) {
    const cell = createElement('th', '');
    Object.defineProperty(cell, 'offsetWidth', { get: () => width });
    head.append(cell);
  }
  table.append(head);
  const cells = LABELS.map((label) => {
    const button = createElement('button', '', label);
    createElement('th', '').append(button);
    return { button, name: label };
  });
  host.append(table);
  document.body.append(host);
  const column = new NameColumn(table, cells);
  const shown = () => cells.map(({ button }) => button.textContent);
  return { column, table, shown, cells };
}

it('is as wide as the names, and says them whole to whoever listens where they are cut', () => {
  const room = { px: 400 };
  const { column, table, shown, cells } = columnIn(room);
  column.fit();
  expect(shown()).toEqual(LABELS);
  const wide = Number.parseFloat(table.style.getPropertyValue('--joint-width'));
  expect(wide).toBeGreaterThanOrEqual(20 * 7);
  expect(wide).toBeLessThan(20 * 7 + 10);
  expect(cells[0]!.button.hasAttribute('aria-label')).toBe(false);

  room.px = 290;
  column.fit();
  expect(new Set(shown()).size).toBe(3);
  expect(shown()[0]).toContain('…');
  expect(cells[0]!.button.getAttribute('aria-label')).toBe(LABELS[0]);
  expect(table.dataset.crowded).toBe('');

  room.px = 200;
  column.fit();
  expect(table.dataset.crowded, 'columns that stand in the card make room').toBe('more');
  expect(new Set(shown()).size).toBe(3);

  room.px = 400;
  column.fit();
  expect(shown()).toEqual(LABELS);
  expect(cells[0]!.button.hasAttribute('aria-label')).toBe(false);
  expect(table.dataset.crowded).toBe('');
});

it('waits until there is room at all', () => {
  const { column, table, shown } = columnIn({ px: 0 });
  column.fit();
  expect(shown()).toEqual(LABELS);
  expect(table.style.getPropertyValue('--joint-width')).toBe('');
});
