import { LatePart } from '../../browser/late_part.ts';
import { couldStand } from '../../twin/balance/lacks.ts';
import { late, onDemand } from '../shell/late.tsx';
import { type RobotLink, useVersion } from '../state/robot_link.ts';
import { settings, useSettings } from '../state/settings.ts';

/** Reports balance. Loaded only for robots that can stand, and only when the viewer wants it. */
export const BALANCE = new LatePart(async () => {
  const parts = [import('./balance_watch.ts'), import('./BalanceView.tsx')] as const;
  const [{ balanceOf }, { spokenStance }] = await Promise.all(parts);
  return { balanceOf, spokenStance };
}, onDemand);
/** Plots the balance numbers. */
export const BALANCE_TRACES = new LatePart(() => import('./balance_watch.ts'), onDemand);

const Stood = late(async () => (await import('./BalanceView.tsx')).Stood, onDemand);
const BalanceTable = late(async () => {
  void BALANCE_TRACES.load(); // so that listed values can be plotted
  return (await import('./BalanceView.tsx')).BalanceTable;
}, onDemand);

/** Whether the page may report this robot's balance; the model has the final word. */
export function mayTell({ twin }: RobotLink): boolean {
  const { balance } = settings();
  return balance === 'on' || (balance === 'auto' && couldStand(twin.schema));
}

/** One sentence about a robot's balance, for robots and viewers that want it; empty otherwise. `brief`: in two or three words;
 *  `tucked`: on a small stage, these open the sentence. */
export function BalanceLine(props: {
  link: RobotLink;
  className?: string;
  brief?: boolean;
  tucked?: boolean;
}) {
  useSettings();
  useVersion(props.link);
  return mayTell(props.link) ? <Stood {...props} /> : null;
}

/** The numbers of a robot's balance, for robots and viewers that want them; empty otherwise. */
export function BalanceNumbers({ link }: { link: RobotLink }) {
  useSettings();
  useVersion(link);
  return mayTell(link) ? <BalanceTable link={link} /> : null;
}
