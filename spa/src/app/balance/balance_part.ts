/** All that tells of balance, in one part of the page that is loaded when it is wanted. */
export { BalanceTable } from './BalanceTable.tsx';
export { balanceTraces } from './balance_traces.ts';
export { balanceOf } from './balance_watch.ts';
export { Stood } from './Stood.tsx';
export { spokenStance } from './spoken_stance.ts';
export { lackWords } from './stance_words.ts';
