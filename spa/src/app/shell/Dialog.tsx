import './styles/dialog.css';
import { type ReactNode, useEffect, useRef } from 'react';
import { useText } from '../text/language.ts';
import { Icon, IconButton } from './icons.tsx';

/** A modal dialog, open as long as it is mounted. Escape, the close button and a tap outside it call `onClose`. */
export function Dialog(props: { title: string; testId: string; onClose: () => void; children: ReactNode }) {
  const { title, testId, onClose, children } = props;
  const text = useText();
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => {
    dialog.current?.showModal();
    dialog.current?.focus(); // not the first button, which would look like a recommendation
  }, []);
  return (
    // biome-ignore lint/a11y/useKeyWithClickEvents: Escape closes a dialog by itself
    <dialog
      className="settings"
      ref={dialog}
      tabIndex={-1}
      onClose={onClose}
      onClick={(event) => event.target === dialog.current && dialog.current.close()}
      aria-label={title}
      data-testid={testId}
    >
      <div className="settings-inner">
        <header>
          <h2>{title}</h2>
          <IconButton label={text.close} onClick={() => dialog.current?.close()}>
            <Icon>
              <path d="M6 6l12 12M18 6L6 18" />
            </Icon>
          </IconButton>
        </header>
        {children}
      </div>
    </dialog>
  );
}
