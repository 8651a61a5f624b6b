import { type RefObject, useEffect, useEffectEvent, useRef, useState } from 'react';
import { LatePart } from '../../browser/late_part.ts';
import { answers, untilRetry } from '../../browser/retry.ts';
import { Debounce, Emitter } from '../../kit.ts';
import type { ModelReport } from '../../model/report.ts';
import type { DrawingTrouble } from '../../scene/figure/adaptive_quality.ts';
import type { BodyView, RowView } from '../../scene/figure/body_view.ts';
import { PageVisibility } from '../../stream/client.ts';
import { isolated } from '../../twin/names.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { shownScene } from '../shell/debug_api.ts';
import { startWhenLoaded } from '../shell/late.tsx';
import { type PageTheme, useTheme } from '../shell/theme.ts';
import { isGuest } from '../state/address.ts';
import { changeSettings, type Settings, settings, useSettings } from '../state/settings.ts';
import { say } from '../text/language.ts';

/** Loads the 3D view, a separate chunk. Rejects if it can't be loaded. The label styles come with the code that draws labels,
 *  `sign_link.ts`. */
export function loadThree() {
  return import('../../scene/three/index.ts');
}

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
  /** Tells of each picture. */
  readonly drawn: Emitter;
  /** Changes the setting `body`, and with it the renderer. */
  readonly choose: (way: '3d' | 'light') => void;
}

const NOTHING = { view: null, trouble: null, why: null, coming: false } as const;

/** Called with each new view; returns a clean-up function. */
export type Begin = (view: RowView) => () => void;

/** Opens the view of one or several robots: 3D if the browser has it, otherwise the light view; each is a separate chunk. A new
 *  view is opened when `prepare` changes. */
export function useBodyView(
  host: RefObject<HTMLDivElement | null>,
  prepare: () => Promise<Begin>,
): ShownBody {
  const theme = useTheme();
  const [drawn] = useState(() => new Emitter());
  const themeNow = useEffectEvent(() => theme);
  const [shown, setShown] = useState<Omit<ShownBody, 'choose' | 'drawn'>>(NOTHING);
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
      const view = await (way === '3d'
        ? open3d(host, () => themeNow(), { onTrouble, onDrawn: drawn.emit })
        : openLight(host, () => themeNow(), { onSlow, onDrawn: drawn.emit }));
      if (left || view === null) {
        view?.dispose();
        return;
      }
      made = view;
      if (isGuest()) view.setFingers('two'); // before its camera's controls have loaded
      stop = begin(view);
      shownScene.set(view);
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
      shownScene.set(null);
      setShown(NOTHING);
      made?.dispose();
    };
  }, [host, prepare, drawn, way]);

  const { view } = shown;
  useEffect(() => view?.setTheme(theme), [view, theme]);
  useEffect(() => (view === null ? undefined : sleepUnseen(view)), [view]);
  return {
    ...shown,
    drawn,
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

type ThemeNow = () => PageTheme;

/** The browser has WebGL, but gave the scene no context. */
class NoContext extends Error {}

async function open3d(
  host: RefObject<HTMLDivElement | null>,
  theme: ThemeNow,
  hears: { onTrouble: (trouble: DrawingTrouble | null) => void; onDrawn: () => void },
): Promise<RowView | null> {
  const Scene = await (await THREE.load()).painted();
  if (host.current === null) return null;
  try {
    return new Scene(host.current, { theme: theme(), ...hears });
  } catch (cause) {
    throw new NoContext('no 3D', { cause });
  }
}

async function openLight(
  host: RefObject<HTMLDivElement | null>,
  theme: ThemeNow,
  hears: { onSlow: (slow: boolean) => void; onDrawn: () => void },
): Promise<RowView | null> {
  const { LightView } = await LIGHT_VIEW.load();
  return host.current === null ? null : new LightView(host.current, { theme: theme(), ...hears });
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

/** Loads the model at `url` with `load` and reports the result. If something failed to load for a temporary reason, it is loaded
 *  again, but only once its server answers, because loading removes what is shown. Returns a function that stops this; nothing is
 *  reported after that. */
export function keepLoading(
  url: string,
  load: () => Promise<ModelReport>,
  report: (result: ModelReport) => void,
): () => void {
  let left = false;
  const keepTrying = async () => {
    for (let failures = 1; ; ) {
      const result = await load();
      if (left) return;
      report(result);
      if (result.passing !== true) return;
      do {
        await untilRetry(failures);
        failures += 1;
      } while (!left && !(await answers(url)));
      if (left) return;
    }
  };
  void keepTrying();
  return () => {
    left = true;
  };
}

/** A hidden tab keeps its picture ready for this long, because people flip through tabs. */
export const READY_MS = 30_000;

/** Puts a view to sleep while nobody sees it: in a frame that is scrolled away at once, in a hidden tab after `READY_MS`. Returns
 *  a function that stops this. */
export function sleepUnseen(view: Pick<BodyView, 'setAsleep'>): () => void {
  const sleepLater = new Debounce(READY_MS, () => view.setAsleep(true));
  const visibility = new PageVisibility((seen) => {
    sleepLater.cancel();
    if (!seen && document.hidden) sleepLater.restart();
    else view.setAsleep(!seen);
  });
  if (!visibility.visible) sleepLater.restart();
  return () => {
    sleepLater.cancel();
    visibility.close();
  };
}

const CONTROLS = new LatePart(() => import('./camera_controls.ts'));

/** Attaches camera keys, double taps and insets while a body is shown; with a twin, also joint selection by tap.
 *  Their code is loaded with the body. */
export function useCameraControls(
  host: RefObject<HTMLElement | null>,
  view: BodyView | null,
  twin: RobotTwin | null = null,
): void {
  useEffect(() => {
    const element = host.current;
    if (view === null || element === null) return;
    return startWhenLoaded(
      CONTROLS.load().then(({ attachCameraControls, bindInsets, bindSelection }) => () => {
        const ends = [attachCameraControls(element, view), bindInsets(element, view)];
        if (twin !== null) ends.push(bindSelection(element, view, twin));
        return () => {
          for (const end of ends) end();
        };
      }),
    );
  }, [host, view, twin]);
}
