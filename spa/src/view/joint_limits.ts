/** The limits of a selected joint, among the balance signs; loaded when a joint is selected. */
export { drawJointLimits } from '../overlays/balance/joint_arc.ts';
