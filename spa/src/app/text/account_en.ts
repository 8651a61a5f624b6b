/** The English sentences for signing in and out. They are loaded with the sign-in button. */
export const accountEn = {
  signIn: 'Sign in',
  signOut: 'Sign out',
  account: 'Account',
  whySignIn: 'Some robots are shared with people who have an account here.',
  email: 'E-mail',
  password: 'Password',
  signedInAs: (name: string) => `You are signed in as ${name}.`,
  signInNotGood: 'E-mail and password do not fit together.',
  signInDisabled: 'This account has been closed.',
  signInTooMany: 'Too many tries. Wait a few minutes, then try again.',
  signInNoAnswer: 'Nobody answers who could sign you in. Check the connection and try again.',
};

/** The sentences for signing in and out, in any language. */
export type AccountText = typeof accountEn;
