/** What tells of balance in words, in one part of the page that is loaded when it is wanted. */
export { balanceOf } from './balance_watch.ts';
export { Stood } from './Stood.tsx';
export { spokenStance } from './spoken_stance.ts';
export { lackWords } from './stance_words.ts';
