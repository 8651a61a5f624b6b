import type { Schema } from '@posecast/wire';

/** Whether a robot may stand on feet, by its schema alone: before its model is read, nobody knows for sure. */
export function couldStand(schema: Schema | null): boolean {
  if (schema === null) return false;
  const { balance, sensors } = schema.mapping;
  if (balance.feet !== null) return balance.feet.length > 0;
  const mounted = [...sensors.values()].filter(({ kind, link }) => kind === 'wrench' && link !== null);
  return mounted.length > 1;
}
