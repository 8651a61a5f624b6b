import { late, onDemand } from '../shell/late.tsx';
import { type RobotLink, useVersion } from '../state/robot_link.ts';
import { useSettings } from '../state/settings.ts';
import { BALANCE, mayTell } from './load_balance.ts';

const Stood = late(async () => (await BALANCE.load()).Stood, onDemand);

/** One sentence about a robot's balance, for robots and viewers that want it; empty otherwise. `brief`: in two or three words. */
export function BalanceLine(props: { link: RobotLink; className?: string; brief?: boolean }) {
  useSettings();
  useVersion(props.link);
  return mayTell(props.link) ? <Stood {...props} /> : null;
}
