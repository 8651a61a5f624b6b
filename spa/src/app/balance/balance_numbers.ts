/** The numbers of balance as a table and as traces, in one part of the page that is loaded when a table is drawn. */
export { BalanceTable } from './BalanceTable.tsx';
export { balanceTraces } from './balance_traces.ts';
