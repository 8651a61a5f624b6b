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
import { accounts } from '../relay/relay.ts';
import { setAccountName } from './account_name.ts';
import { setAccountToken } from './token.ts';

/** Signing in by Firebase. A chunk of its own: only who signs in, or has done so here before, loads it. */

/** A token is an hour old at most; a new one is fetched so long before its end. */
const BEFORE_MS = 5 * 60_000;
const AGAIN_MS = 30_000;
/** A page without an answer goes on without an account, and with it as soon as it comes. */
const RESUME_LATE_MS = 4000;

if (accounts === null) throw new Error('nobody signs in here');
const { emulator, ...project } = accounts;
// Without popups and redirects: those need a script of another origin, which this page runs for nobody.
const auth = initializeAuth(initializeApp(project), {
  persistence: [indexedDBLocalPersistence, browserLocalPersistence],
});
if (emulator !== undefined) connectAuthEmulator(auth, emulator, { disableWarnings: true });

let renewedMs = 0;
let timer: ReturnType<typeof setTimeout> | undefined;
const known = new Promise<void>((done) => {
  onIdTokenChanged(auth, async (user) => {
    await take(user).catch(() => {}); // no token now: a try follows
    done();
  });
});

/** Resolves when it is known who is signed in, or when that takes too long. */
export async function restoreSession(): Promise<void> {
  await Promise.race([known, new Promise((late) => setTimeout(late, RESUME_LATE_MS))]);
}

/** Throws what Firebase says. */
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

/** Another token for the same account; `onIdTokenChanged` hears of it. Who was disabled or revoked is signed out by this. */
async function renew(user: User): Promise<void> {
  clearTimeout(timer);
  timer = setTimeout(() => void renew(user), AGAIN_MS);
  renewedMs = Date.now();
  try {
    await user.getIdToken(true);
  } catch {
    // no way there: tried again
  }
}

// After sleep a timer is late, and so is the token.
window.addEventListener('online', () => auth.currentUser && void renew(auth.currentUser));
