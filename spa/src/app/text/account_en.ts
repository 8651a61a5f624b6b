/** The English sentences for signing in and out. They are loaded with the sign-in button. */
export const accountEn = {
  signIn: 'Sign in',
  signOut: 'Sign out',
  account: 'Account',
  whySignIn: 'Some robots are shared with people who have an account here.',
  email: 'E-mail',
  password: 'Password',
  signedInAs: (name: string) => `You are signed in as ${name}.`,
  signInNotGood: 'Wrong e-mail or password.',
  signInDisabled: 'This account is disabled.',
  signInTooMany: 'Too many attempts. Wait a few minutes, then try again.',
  signInNoAnswer: 'The sign-in service does not answer. Check the connection and try again.',
};

/** The sentences for signing in and out, in any language. */
export type AccountText = typeof accountEn;
