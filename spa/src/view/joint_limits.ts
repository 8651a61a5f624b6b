/** The limits of a selected joint, among the signs of balance; loaded when there is one. */
export { drawJointLimits } from '../overlays/balance/joint_arc.ts';
