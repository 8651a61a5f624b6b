import { type RefObject, useEffect, useRef, useState } from 'react';
import { LatePart } from '../../browser/late_part.ts';
import type { DrawingTrouble } from '../../scene/figure/adaptive_quality.ts';
import type { RowView } from '../../scene/figure/body_view.ts';
import { isolated } from '../../twin/names.ts';
import { showScene } from '../shell/debug_api.ts';
import { type PageTheme, useTheme } from '../shell/theme.ts';
import { changeSettings, type Settings, settings, useSettings } from '../state/settings.ts';
import { say } from '../text/language.ts';
import { loadThree } from './load_three.ts';

const THREE = new LatePart(loadThree, () => false); // loaded at once if the browser has 3D
const LIGHT_VIEW = new LatePart(() => import('../../scene/canvas2d/view.ts'));

/** Why the body is not drawn in full 3D quality. `light`: the browser has no 3D; `light-pixels`: it has none, and the light view
 *  is slow as well; `given-up`: the browser took 3D away; `slow`: 3D was too slow; `chosen`: the person chose the light view. For
 *  the others see `DrawingTrouble`. */
export type ViewTrouble =
  | Exclude<DrawingTrouble, 'failed' | 'hopeless'>
  | 'light'
  | 'light-pixels'
  | HandMade;
type HandMade = 'given-up' | 'slow' | 'chosen';

/** The view of a body, and how it is drawn. */
export interface ShownBody {
  /** null until its code has loaded. */
  readonly view: RowView | null;
  /** null while the body is drawn in full 3D quality. */
  readonly trouble: ViewTrouble | null;
  /** Why there is no picture at all; null if nothing prevents it. */
  readonly why: string | null;
  /** Whether the picture may still come: its code failed to load and is being requested again. */
  readonly coming: boolean;
  /** Changes the setting `body`, and with it the renderer. */
  readonly choose: (way: '3d' | 'light') => void;
}

const NOTHING = { view: null, trouble: null, why: null, coming: false } as const;

/** Called with each new view; returns a clean-up function. */
export type Begin = (view: RowView) => () => void;

/** Opens the view of one or several robots: 3D if the browser has it, otherwise the light view; each is a separate chunk. A new
 *  view is opened when `prepare` or `onDrawn` (called after every picture) changes. */
export function useBodyView(
  host: RefObject<HTMLDivElement | null>,
  prepare: () => Promise<Begin>,
  onDrawn?: () => void,
): ShownBody {
  const theme = useTheme();
  const themeNow = useRef(theme);
  themeNow.current = theme;
  const [shown, setShown] = useState<Omit<ShownBody, 'choose'>>(NOTHING);
  const { body } = useSettings();
  /** Draw in 3D, or in the light view for the given reason. */
  const [way, setWay] = useState<'3d' | 'light' | HandMade>(() => wayFor(body));
  const wanted = useRef(body);
  useEffect(() => {
    if (wanted.current === body) return;
    wanted.current = body;
    setWay(wayFor(body));
  }, [body]);

  useEffect(() => {
    let left = false;
    let stop: (() => void) | null = null;
    let made: RowView | null = null;
    const code: LatePart<unknown> = way === '3d' ? THREE : LIGHT_VIEW;
    const leave = code.subscribe(() => {
      const coming = code.failed();
      const why = coming ? say().tryingAgain(say().notHere) : null;
      if (!left) setShown((before) => (before.view === null ? { ...NOTHING, coming, why } : before));
    });
    const open = async () => {
      const onTrouble = (trouble: DrawingTrouble | null) => {
        if (trouble === 'failed') setWay('given-up');
        else if (trouble !== 'hopeless') setShown((before) => ({ ...before, trouble }));
        else if (settings().body === 'auto')
          LIGHT_VIEW.load().then(() => {
            if (!left) setWay('slow'); // until then a slow picture is better than none
          });
      };
      const onSlow = (slow: boolean) => {
        if (way === 'light') setShown((before) => ({ ...before, trouble: slow ? 'light-pixels' : 'light' }));
      };
      const begin = await prepare();
      const heard = onDrawn === undefined ? {} : { onDrawn };
      const view = await (way === '3d'
        ? open3d(host, themeNow, { onTrouble, ...heard })
        : openLight(host, themeNow, { onSlow, ...heard }));
      if (left || view === null) {
        view?.dispose();
        return;
      }
      made = view;
      stop = begin(view);
      showScene(view);
      const trouble = way === '3d' ? null : way;
      setShown({ ...NOTHING, view, trouble });
    };
    open().catch((error: unknown) => {
      if (left) return;
      if (error instanceof NoContext) {
        setWay('light');
        return;
      }
      const what = error instanceof Error ? error.message : String(error);
      setShown({ ...NOTHING, why: say().bodyFailed(isolated(what)) });
    });
    return () => {
      left = true;
      leave();
      stop?.();
      showScene(null);
      setShown(NOTHING);
      made?.dispose();
    };
  }, [host, prepare, onDrawn, way]);

  const { view } = shown;
  useEffect(() => view?.setTheme(theme), [view, theme]);
  return {
    ...shown,
    choose: (wish) => {
      changeSettings({ body: wish });
      setWay(wayFor(wish));
    },
  };
}

function wayFor(body: Settings['body']): '3d' | 'light' | 'chosen' {
  if (!hasWebGl()) return 'light';
  return body === 'light' ? 'chosen' : '3d';
}

type ThemeNow = RefObject<PageTheme>;

/** The browser has WebGL, but gave the scene no context. */
class NoContext extends Error {}

async function open3d(
  host: RefObject<HTMLDivElement | null>,
  theme: ThemeNow,
  hears: { onTrouble: (trouble: DrawingTrouble | null) => void; onDrawn?: () => void },
): Promise<RowView | null> {
  const Scene = await (await THREE.load()).painted();
  if (host.current === null) return null;
  try {
    return new Scene(host.current, { theme: theme.current, ...hears });
  } catch (cause) {
    throw new NoContext('no 3D', { cause });
  }
}

async function openLight(
  host: RefObject<HTMLDivElement | null>,
  theme: ThemeNow,
  hears: { onSlow: (slow: boolean) => void; onDrawn?: () => void },
): Promise<RowView | null> {
  const { LightView } = await LIGHT_VIEW.load();
  return host.current === null ? null : new LightView(host.current, { theme: theme.current, ...hears });
}

/** Whether the browser can make a WebGL 2 context. */
export function hasWebGl(): boolean {
  try {
    const context = document.createElement('canvas').getContext('webgl2');
    context?.getExtension('WEBGL_lose_context')?.loseContext(); // a page may hold few contexts
    return context !== null;
  } catch {
    return false;
  }
}
