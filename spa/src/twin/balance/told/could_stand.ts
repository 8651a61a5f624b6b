import type { Schema } from '@posecast/wire';

/** Whether a robot may stand on two feet that measure their forces, by its schema alone: its model says whether it does. */
export function couldStand(schema: Schema | null): boolean {
  const sensors = [...(schema?.mapping.sensors.values() ?? [])];
  return sensors.filter(({ kind, link }) => kind === 'wrench' && link !== null).length > 1;
}
