import { type RefObject, useCallback, useEffect, useState } from 'react';

/** Whether the body is shown alone. `screen`: the browser's fullscreen mode; `page`: the body fills the page, because the
 *  browser has no fullscreen here (an iPhone, an iframe without that permission). */
export type Fullscreen = 'off' | 'screen' | 'page';

/** The fullscreen state of the element `page`, and a function that switches it on or off. Escape switches it off, too. */
export function useFullscreen(page: RefObject<HTMLElement | null>): {
  fullscreen: Fullscreen;
  toggle: () => void;
} {
  const [fullscreen, setFullscreen] = useState<Fullscreen>('off');

  useEffect(() => {
    const changed = () => setFullscreen(document.fullscreenElement === null ? 'off' : 'screen');
    document.addEventListener('fullscreenchange', changed);
    return () => document.removeEventListener('fullscreenchange', changed);
  }, []);

  useEffect(() => {
    if (fullscreen !== 'page') return;
    // in the browser's own fullscreen mode the browser handles Escape
    const leave = (event: KeyboardEvent) => event.key === 'Escape' && setFullscreen('off');
    window.addEventListener('keydown', leave);
    return () => window.removeEventListener('keydown', leave);
  }, [fullscreen]);

  const toggle = useCallback(() => {
    if (fullscreen === 'page') setFullscreen('off');
    else if (document.fullscreenElement) void document.exitFullscreen();
    else if (document.fullscreenEnabled && page.current?.requestFullscreen) {
      page.current.requestFullscreen().catch(() => setFullscreen('page'));
    } else setFullscreen('page');
  }, [fullscreen, page]);

  return { fullscreen, toggle };
}
