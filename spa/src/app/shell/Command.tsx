import '../styles/command.css';
import { useState } from 'react';
import { useListText } from '../text/list.ts';
import { CheckIcon, CopyIcon } from './icons.tsx';

/** A line to be used elsewhere, with a button that copies it. */
export function Command({ what, line }: { what: string; line: string }) {
  const rest = useListText();
  const [copied, setCopied] = useState(false);
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(line);
      setCopied(true);
      setTimeout(() => setCopied(false), 2000);
    } catch {
      // Not allowed here (an insecure origin): the line can still be selected by hand.
    }
  };
  return (
    <figure className="command">
      <figcaption>{what}</figcaption>
      <pre>
        <code>{line}</code>
      </pre>
      <button
        type="button"
        className="icon-button"
        onClick={copy}
        aria-label={copied ? rest.copied : rest.copy}
      >
        {copied ? <CheckIcon /> : <CopyIcon />}
      </button>
    </figure>
  );
}
