import { type RefObject, useEffect, useRef, useState } from 'react';
import { usePageKeys } from './page_keys.ts';

/** The state of a popover. While it is open, Escape or a press outside the element `around` closes it. */
export function usePopover<T extends HTMLElement>(): {
  open: boolean;
  setOpen: (open: boolean) => void;
  around: RefObject<T | null>;
} {
  const [open, setOpen] = useState(false);
  const around = useRef<T>(null);
  useEffect(() => {
    if (!open) return;
    const leave = ({ target }: Event) => {
      if (!around.current?.contains(target as Node)) setOpen(false);
    };
    window.addEventListener('pointerdown', leave);
    return () => window.removeEventListener('pointerdown', leave);
  }, [open]);
  usePageKeys(open ? () => ({ close: () => setOpen(false) }) : null, around);
  return { open, setOpen, around };
}
