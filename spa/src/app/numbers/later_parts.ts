/** Parts of the numbers that can wait until the body is drawn, in one chunk. */
export { carryValues } from './grid/value_drag.ts';
export { NameColumn, titledLimbs } from './table/arrangement.ts';
