/** The balance numbers as a table and as traces: one chunk, loaded when a table is drawn. */
export { BalanceTable } from './BalanceTable.tsx';
export { balanceTraces } from './balance_traces.ts';
