import { createStore } from '../../kit.ts';
import type { BodyView } from '../../scene/figure/body_view.ts';
import type { RobotScene } from '../../scene/three/index.ts';
import type { RobotLink } from '../state/robot_link.ts';
import type { Settings } from '../state/settings.ts';
import { settings } from '../state/settings.ts';
import { cost } from './refresh.ts';

/** Members that only the 3D renderer, or only the light view, has. */
type OfOneView = Pick<RobotScene, 'signsOf' | 'robots' | 'topOf' | 'pixelRatio' | 'keepSharp'> & {
  readonly pictureMs: number;
};

/** `window.posecast`: read-only values of the open page, for tests and for debugging in the console. */
interface DebugApi {
  readonly twin: {
    readonly seq: number | null;
    readonly t_s: number | null;
    readonly liveness: string | null;
    readonly cause: string | null;
    /** The moment of the past whose pose is shown, unix ms by the relay's clock; null in the present, and while that pose is
     *  loading. */
    readonly moment_ms: number | null;
    value(field: string, label: string): number | null | undefined;
  } | null;
  readonly link: {
    /** The frame rate that the relay granted, Hz; null until it has said so. */
    readonly granted_hz: number | null;
    /** The transport in use: `websocket`, `events` (server-sent events over HTTP), `mirror` (a database) or `segments` (the
     *  relay's past, read as it grows). */
    readonly carrier: string;
    /** The delay of the picture, ms; null: none. */
    readonly behind_ms: number | null;
  } | null;
  readonly scene: (Omit<BodyView, 'load' | 'play' | 'setPose' | 'dispose'> & Partial<OfOneView>) | null;
  /** What tables, card and plots have cost so far: the number of writes, and the script time for them, ms. */
  readonly numbers: { readonly writes: number; readonly scriptMs: number };
  readonly settings: Settings;
}

declare global {
  interface Window {
    posecast?: DebugApi;
  }
}

/** The robot that `window.posecast` is about; null while none is shown. */
export const shownLink = createStore<RobotLink | null>(null);
/** The view of its body; null while none is shown. */
export const shownScene = createStore<BodyView | null>(null);

/** Defines `window.posecast`. Its values are read at each access, so they are always current. */
export function installDebugApi(): void {
  window.posecast = {
    get twin() {
      const link = shownLink.get();
      if (link === null) return null;
      const { twin, watch } = link;
      return {
        get seq() {
          return twin.state?.seq ?? null;
        },
        get t_s() {
          return twin.state?.tS ?? null;
        },
        get liveness() {
          return watch.verdict().word;
        },
        get cause() {
          return watch.verdict().cause;
        },
        get moment_ms() {
          const { past } = watch.verdict();
          return past?.isHere ? past.momentMs : null;
        },
        value: (field: string, label: string) => twin.value(field, label),
      };
    },
    get link() {
      const link = shownLink.get();
      if (link === null) return null;
      const { grantedHz, by, behindMs } = link.client.link;
      return { granted_hz: grantedHz, carrier: by, behind_ms: behindMs };
    },
    get scene() {
      return shownScene.get();
    },
    get numbers() {
      return cost;
    },
    get settings() {
      return settings();
    },
  };
}
