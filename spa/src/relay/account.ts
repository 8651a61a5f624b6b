import { initializeApp } from '@firebase/app';
import {
  browserLocalPersistence,
  connectAuthEmulator,
  indexedDBLocalPersistence,
  initializeAuth,
  onIdTokenChanged,
  signInWithEmailAndPassword,
  signOut as signOutOf,
  type User,
} from '@firebase/auth';
import { accounts } from './relay.ts';
import { setAccountToken } from './token.ts';
import { setAccountName } from './visitor.ts';

/** Signing in with Firebase. A separate chunk, loaded only for people who sign in or have signed in here before. */

/** Tokens last an hour; a new one is fetched this long before expiry. */
const BEFORE_MS = 5 * 60_000;
const AGAIN_MS = 30_000;
/** How long the page waits for the account at start. After that it continues without one, and uses the account when it
 *  arrives. */
const RESUME_LATE_MS = 4000;

if (accounts === null) throw new Error('nobody signs in here');
const { emulator, ...project } = accounts;
// No popups or redirects: they need a script from another origin, which this page does not allow.
const auth = initializeAuth(initializeApp(project), {
  persistence: [indexedDBLocalPersistence, browserLocalPersistence],
});
if (emulator !== undefined) connectAuthEmulator(auth, emulator, { disableWarnings: true });

let renewedMs = 0;
let timer: ReturnType<typeof setTimeout> | undefined;
const known = new Promise<void>((done) => {
  onIdTokenChanged(auth, async (user) => {
    await take(user).catch(() => {}); // no token now; retried later
    done();
  });
});

/** Resolves when it is known who is signed in, or after `RESUME_LATE_MS`. */
export async function restoreSession(): Promise<void> {
  await Promise.race([known, new Promise((late) => setTimeout(late, RESUME_LATE_MS))]);
}

/** Signs in. Rejects with Firebase's error. */
export async function signIn(email: string, password: string): Promise<void> {
  const { user } = await signInWithEmailAndPassword(auth, email, password);
  await take(user);
}

export async function signOut(): Promise<void> {
  await signOutOf(auth);
  await take(null);
}

async function take(user: User | null): Promise<void> {
  clearTimeout(timer);
  if (user === null) {
    setAccountName(null);
    setAccountToken('');
    return;
  }
  setAccountName(user.email ?? user.uid);
  timer = setTimeout(() => void renew(user), AGAIN_MS);
  const { token, expirationTime } = await user.getIdTokenResult();
  setAccountToken(token);
  clearTimeout(timer);
  const inMs = new Date(expirationTime).getTime() - Date.now() - BEFORE_MS;
  timer = setTimeout(() => void renew(user), Math.max(AGAIN_MS, inMs));
}

/** Fetches another token because a relay did not accept this one; at most twice a minute, however many ask. */
export function renewRejectedToken(): void {
  const { currentUser } = auth;
  if (currentUser !== null && Date.now() - renewedMs >= AGAIN_MS) void renew(currentUser);
}

/** Fetches a new token, reported through `onIdTokenChanged`. If the account is disabled or revoked, this signs it out. */
async function renew(user: User): Promise<void> {
  clearTimeout(timer);
  timer = setTimeout(() => void renew(user), AGAIN_MS);
  renewedMs = Date.now();
  try {
    await user.getIdToken(true);
  } catch {
    // not reachable; retried later
  }
}

// After sleep, timers fire late and the token may have expired.
window.addEventListener('online', () => auth.currentUser && void renew(auth.currentUser));
