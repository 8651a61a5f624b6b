import { type RefObject, useCallback, useEffect, useState } from 'react';
import { usePageKeys } from '../shell/page_keys.ts';

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

  // in the browser's own fullscreen mode the browser handles Escape
  usePageKeys(fullscreen === 'page' ? () => ({ close: () => setFullscreen('off') }) : null);

  const toggle = useCallback(() => {
    if (fullscreen === 'page') setFullscreen('off');
    else if (document.fullscreenElement) void document.exitFullscreen();
    else if (document.fullscreenEnabled && page.current?.requestFullscreen) {
      page.current.requestFullscreen().catch(() => setFullscreen('page'));
    } else setFullscreen('page');
  }, [fullscreen, page]);

  return { fullscreen, toggle };
}
