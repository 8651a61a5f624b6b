/** Draws balance and describes it in words: one chunk, loaded on demand. */
export { makeBalance } from '../../view/balance.ts';
export { balanceOf } from './balance_watch.ts';
export { Stood } from './Stood.tsx';
export { spokenStance } from './spoken_stance.ts';
