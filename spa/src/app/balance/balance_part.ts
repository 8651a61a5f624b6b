/** What draws balance and tells of it in words, in one part of the page that is loaded when it is wanted. */
export { makeBalance } from '../../view/balance.ts';
export { balanceOf } from './balance_watch.ts';
export { Stood } from './Stood.tsx';
export { spokenStance } from './spoken_stance.ts';
