/** What arranges the joint table once it stands: it comes after the first paint. */
export { titledLimbs } from './limb_titles.ts';
export { NameColumn } from './name_column.ts';
