import type { FromStream } from '../messages.ts';

/** What a lane asks for. `do: 'end'`: nothing more comes, for that reason, in the codes of the close table (wire/SPEC.md). */
export type LaneAction =
  /** Get this, below the address of the robot's past. An earlier request that is still open is given up. */
  | { readonly do: 'ask'; readonly path: string }
  /** Get this beside it. An earlier one is given up. */
  | { readonly do: 'look'; readonly path: string }
  | { readonly do: 'post'; readonly message: FromStream }
  /** The relay has answered: the stream is open. */
  | { readonly do: 'open' }
  | { readonly do: 'end'; readonly code: number; readonly reason: string };
