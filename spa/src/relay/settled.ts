import { accounts, relaySettled, wasSignedIn } from './relay.ts';
import { withholdTokens } from './token.ts';

let asking: ReturnType<typeof relaySettled> | null = null;

/** Resolves when it is known which relay this page reads and, if somebody has signed in here before, whether they still are.
 *  Later calls get the same result. */
export function accessSettled(): ReturnType<typeof relaySettled> {
  asking ??= relaySettled().then(async (choice) => {
    if (choice.lane !== null && choice.lane !== choice.base) withholdTokens(`${choice.lane}api/v1/`);
    if (accounts !== null && wasSignedIn()) {
      await import('./account.ts').then(({ restoreSession }) => restoreSession()).catch(() => {}); // continue without an account
    }
    return choice;
  });
  return asking;
}
