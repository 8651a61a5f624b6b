/** True when the person has asked their system for less motion: then nothing eases. */
export function wantsStillness(): boolean {
  return window.matchMedia('(prefers-reduced-motion: reduce)').matches;
}
