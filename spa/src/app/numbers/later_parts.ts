/** What the numbers do without until the body stands, in one part. */
export { carryValues } from './grid/value_drag.ts';
export { NameColumn, titledLimbs } from './table/arrangement.ts';
