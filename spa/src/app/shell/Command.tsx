import './styles/command.css';
import { useState } from 'react';
import { useMore } from '../text/language.ts';
import { Icon, IconButton } from './icons.tsx';

const CopyIcon = () => (
  <Icon>
    <rect x="8.5" y="8.5" width="11" height="11" rx="2" />
    <path d="M15.5 8.5V6.5a2 2 0 0 0-2-2h-7a2 2 0 0 0-2 2v7a2 2 0 0 0 2 2h2" />
  </Icon>
);

const CheckIcon = () => (
  <Icon>
    <path d="M5 12.5l4.5 4.5L19 7.5" />
  </Icon>
);

/** A figure with one line of text (a command, a link), a caption `what`, and a button that copies the line. */
export function Command({ what, line }: { what: string; line: string }) {
  const rest = useMore();
  const [copied, setCopied] = useState(false);
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(line);
      setCopied(true);
      setTimeout(() => setCopied(false), 2000);
    } catch {
      // Copying is not allowed here (an insecure origin); the line can still be selected and copied by the person.
    }
  };
  return (
    <figure className="command">
      <figcaption>{what}</figcaption>
      <pre>
        <code>{line}</code>
      </pre>
      <IconButton onClick={copy} label={copied ? rest.copied : rest.copy}>
        {copied ? <CheckIcon /> : <CopyIcon />}
      </IconButton>
    </figure>
  );
}
