import { type RefObject, useCallback, useEffect, useState } from 'react';

/** off; `screen`: the browser gives the element all of it; `page`: it can't (an iPhone, an iframe that may not), so
 *  the body alone covers what the page has. */
export type Fullscreen = 'off' | 'screen' | 'page';

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
    // a screen's fullscreen hears Escape by itself
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
