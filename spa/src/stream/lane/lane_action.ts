import type { FromStream } from '../messages.ts';

/** The actions of a lane. `do: 'end'`: the lane has ended, with a code from the close table (wire/SPEC.md). */
export type LaneAction =
  /** Request this, below the address of the robot's past. Cancels an earlier request that is still open. */
  | { readonly do: 'ask'; readonly path: string }
  /** Send this additional request. Cancels an earlier one. */
  | { readonly do: 'look'; readonly path: string }
  | { readonly do: 'post'; readonly message: FromStream }
  /** The relay has answered: the stream is open. */
  | { readonly do: 'open' }
  | { readonly do: 'end'; readonly code: number; readonly reason: string };
