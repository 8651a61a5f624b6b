/** Standard gravity as a controller would use it, m/s². */
export const GRAVITY = 9.81;

/**
 * The offset of the capture point from the centre of mass per m/s, seconds: √(z/g), with the height z of the centre of mass above
 * the floor (m). The capture point is x + ẋ·√(z/g): a robot that moves like a linear inverted pendulum has to step there to come
 * to rest (Pratt, Carff, Drakunov and Goswami, "Capture Point: A Step toward Humanoid Push Recovery", Humanoids 2006). At or
 * below the floor it is 0.
 */
export function captureTime(heightM: number): number {
  return Math.sqrt(Math.max(0, heightM) / GRAVITY);
}
