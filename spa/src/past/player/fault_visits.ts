import { searchFault } from './fault_search.ts';
import { jump, type PlayerParts } from './seeking.ts';

/** A second press within this time continues from the fault of the first press, however far playback has moved since, ms. */
const AGAIN_MS = 3000;
/** While playing, going back skips a visit that started within this time, because it was just seen, ms. */
const PLAYED_MS = 1000;

/** Goes to the next or previous fault, unless the viewer does something else meanwhile. */
export async function visitFault(parts: PlayerParts, by: 1 | -1): Promise<void> {
  const { ports, state } = parts;
  const { acts, visited, isPast, clock } = state;
  const isAgain = acts === visited.act + 1 && ports.nowMs() - visited.atMs < AGAIN_MS;
  const fromMs = isAgain ? visited.goesMs : state.hereMs;
  const slackMs = !isAgain && isPast && clock.running ? PLAYED_MS : 1;
  const isObsolete = () => acts !== state.acts;
  const mark = await searchFault(parts, by, fromMs, slackMs, isObsolete);
  if (mark === null || isObsolete()) return;
  state.visited = { goesMs: mark.goesMs, atMs: ports.nowMs(), act: acts };
  const keptMs = state.keptMs(mark.goesMs);
  state.leaveLoop(keptMs);
  state.enter();
  jump(parts, keptMs);
}
