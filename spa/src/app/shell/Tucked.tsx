import type { ReactNode } from 'react';
import { usePopover } from './page_keys.ts';

/** Something over the body that must not hide it: on a small stage a button that opens it, on a large one the content itself.
 *  `always`: a button on every stage. The style sheet `tools.css` decides which. */
export function Tucked(props: {
  className?: string;
  always?: boolean;
  /** The button's name, if its content is no text. */
  label?: string;
  /** The content of the button. */
  brief: ReactNode;
  children: ReactNode;
}) {
  const { className = '', always = false, label, brief, children } = props;
  const { open, setOpen, around } = usePopover<HTMLDivElement>();
  return (
    <div className={`tucked ${className}`.trim()} data-always={always} data-open={open} ref={around}>
      <button
        type="button"
        className="pill"
        aria-expanded={open}
        aria-label={label}
        title={label}
        onClick={() => setOpen(!open)}
      >
        {brief}
      </button>
      <div className="tucked-content">{children}</div>
    </div>
  );
}
