import { searchFault } from './fault_marks.ts';
import { jump, type PlayerParts } from './seeking.ts';

/** A second press this soon goes on from the fault that the first went to, however far it has played since, ms. */
const AGAIN_MS = 3000;
/** While it plays, a fault this near before the playhead is where one comes from, ms. */
const PLAYED_MS = 1000;

/** Goes to the next or the previous fault, unless somebody does something else meanwhile. */
export async function visit(parts: PlayerParts, by: 1 | -1): Promise<void> {
  const { ports, state } = parts;
  const { acts, visited, isPast, clock } = state;
  const isAgain = acts === visited.act + 1 && ports.nowMs() - visited.atMs < AGAIN_MS;
  const fromMs = isAgain ? visited.goesMs : state.hereMs;
  const slackMs = !isAgain && isPast && clock.running ? PLAYED_MS : 1;
  const isLeft = () => acts !== state.acts;
  const mark = await searchFault(parts, by, fromMs, slackMs, isLeft);
  if (mark === null || isLeft()) return;
  state.visited = { goesMs: mark.goesMs, atMs: ports.nowMs(), act: acts };
  const keptMs = state.keptMs(mark.goesMs);
  state.leaveLoop(keptMs);
  state.enter();
  jump(parts, keptMs);
}
