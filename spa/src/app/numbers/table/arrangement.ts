/** Arranges the joint table once it is shown; loaded after the first paint. */
export { titledLimbs } from './limb_titles.ts';
export { NameColumn } from './name_column.ts';
