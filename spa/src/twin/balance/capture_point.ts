/** The acceleration of free fall that a controller would use, m/s². */
export const GRAVITY = 9.81;

/**
 * How far the capture point is ahead of the centre of mass for each m/s, seconds: √(z/g), with the height z of the
 * centre of mass above the floor (m). The capture point is x + ẋ·√(z/g), where a robot that moves like a linear
 * inverted pendulum has to step to come to rest (Pratt, Carff, Drakunov and Goswami, "Capture Point: A Step toward
 * Humanoid Push Recovery", Humanoids 2006). At or below the floor it is 0.
 */
export function captureTime(heightM: number): number {
  return Math.sqrt(Math.max(0, heightM) / GRAVITY);
}
