import { type RefObject, useEffect, useRef, useState } from 'react';

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
    const leave = (event: Event) => {
      const leaves =
        event instanceof KeyboardEvent
          ? event.key === 'Escape'
          : !around.current?.contains(event.target as Node);
      if (leaves) setOpen(false);
    };
    window.addEventListener('pointerdown', leave);
    window.addEventListener('keydown', leave);
    return () => {
      window.removeEventListener('pointerdown', leave);
      window.removeEventListener('keydown', leave);
    };
  }, [open]);
  return { open, setOpen, around };
}
