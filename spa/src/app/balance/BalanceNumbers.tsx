import { late, onDemand } from '../shell/late.tsx';
import { type RobotLink, useVersion } from '../state/robot_link.ts';
import { useSettings } from '../state/settings.ts';
import { BALANCE, mayTell } from './load_balance.ts';

const BalanceTable = late(async () => (await BALANCE.load()).BalanceTable, onDemand);

/** The numbers of a robot's balance, for robots and viewers that want them; empty otherwise. */
export function BalanceNumbers({ link }: { link: RobotLink }) {
  useSettings();
  useVersion(link);
  return mayTell(link) ? <BalanceTable link={link} /> : null;
}
