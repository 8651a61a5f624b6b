import { type FormEvent, useEffect, useState, useSyncExternalStore } from 'react';
import { accountName, onAccountName } from '../../relay/visitor.ts';
import { Dialog } from '../shell/Dialog.tsx';
import '../shell/styles/dialog.css';
import { accountText, useAccountText } from '../text/late.ts';

/** The button for signing in or out, with its dialog. `refused`: the relay refused this page; if somebody is signed in,
 *  another token is fetched. */
export function SignIn({ refused = false }: { refused?: boolean }) {
  const text = useAccountText();
  const name = useSyncExternalStore(onAccountName, accountName);
  useEffect(() => {
    if (refused && name !== null)
      import('../../relay/account.ts').then(({ renewRejectedToken }) => renewRejectedToken()).catch(() => {});
  }, [refused, name]);
  const [open, setOpen] = useState(false);
  return (
    <>
      <button type="button" className="text-button" data-testid="sign-in" onClick={() => setOpen(true)}>
        {name ?? text.signIn}
      </button>
      {open && <AccountDialog name={name} onClose={() => setOpen(false)} />}
    </>
  );
}

function AccountDialog({ name, onClose }: { name: string | null; onClose: () => void }) {
  const text = useAccountText();
  const [busy, setBusy] = useState(false);
  const [wrong, setWrong] = useState<string | null>(null);
  const during = async (what: () => Promise<void>) => {
    setBusy(true);
    setWrong(null);
    try {
      await what();
      onClose();
    } catch (error) {
      setWrong(signInWords(error));
      setBusy(false);
    }
  };
  const submit = (event: FormEvent<HTMLFormElement>) => {
    event.preventDefault();
    const said = new FormData(event.currentTarget);
    void during(async () => {
      const { signIn } = await import('../../relay/account.ts');
      await signIn(String(said.get('email')), String(said.get('password')));
    });
  };
  return (
    <Dialog title={name === null ? text.signIn : text.account} testId="account" onClose={onClose}>
      {name === null ? (
        <form className="account" onSubmit={submit}>
          <p className="quiet">{text.whySignIn}</p>
          <label>
            {text.email}
            <input
              className="dialog-field"
              name="email"
              type="email"
              autoComplete="username"
              required
              data-testid="email"
            />
          </label>
          <label>
            {text.password}
            <input
              className="dialog-field"
              name="password"
              type="password"
              autoComplete="current-password"
              required
              data-testid="password"
            />
          </label>
          {wrong !== null && (
            <p className="account-wrong" role="alert" data-testid="sign-in-wrong">
              {wrong}
            </p>
          )}
          <button type="submit" className="dialog-go" disabled={busy} data-testid="sign-in-go">
            {text.signIn}
          </button>
        </form>
      ) : (
        <div className="account">
          <p>{text.signedInAs(name)}</p>
          <button
            type="button"
            className="dialog-go"
            disabled={busy}
            data-testid="sign-out"
            onClick={() => during(async () => (await import('../../relay/account.ts')).signOut())}
          >
            {text.signOut}
          </button>
        </div>
      )}
    </Dialog>
  );
}

const NOT_GOOD = /invalid-credential|wrong-password|user-not-found|invalid-email|missing-password/;

/** Why signing in failed. A wrong password and an unknown account give the same sentence. `error` is what signing in
 *  threw. */
export function signInWords(error: unknown): string {
  const code = error instanceof Error && 'code' in error ? String(error.code) : '';
  if (NOT_GOOD.test(code)) return accountText().signInNotGood;
  if (/user-disabled/.test(code)) return accountText().signInDisabled;
  if (/too-many-requests/.test(code)) return accountText().signInTooMany;
  return accountText().signInNoAnswer;
}
