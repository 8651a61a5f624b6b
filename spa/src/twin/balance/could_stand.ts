import type { Schema } from '@posecast/wire';

/** Whether a robot may stand on two feet that measure their forces, judging only by its schema; the model has the final word. */
export function couldStand(schema: Schema | null): boolean {
  const sensors = [...(schema?.mapping.sensors.values() ?? [])];
  return sensors.filter(({ kind, link }) => kind === 'wrench' && link !== null).length > 1;
}
