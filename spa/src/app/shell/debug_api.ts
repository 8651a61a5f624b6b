import type { RobotScene } from '../../three/index.ts';
import type { BodyView } from '../../view/body_view.ts';
import { cost } from '../numbers/grid/refresh.ts';
import type { RobotLink } from '../state/robot_link.ts';
import type { Settings } from '../state/settings.ts';
import { settings } from '../state/settings.ts';

/** Members that only one of the two renderers has. */
type OfOneView = Pick<RobotScene, 'signsOf' | 'robots' | 'topOf' | 'pixelRatio' | 'keepSharp'> & {
  readonly pictureMs: number;
};

/** What tests and curious people find under `window.posecast`: the page as it is, read only. */
interface DebugApi {
  readonly twin: {
    readonly seq: number | null;
    readonly t_s: number | null;
    readonly liveness: string | null;
    readonly cause: string | null;
    value(field: string, label: string): number | null | undefined;
  } | null;
  readonly link: {
    /** What the relay has granted; null until it said so. */
    readonly granted_hz: number | null;
    /** `websocket`, or `events` where none gets through. */
    readonly carrier: string;
  } | null;
  readonly scene: (Omit<BodyView, 'load' | 'play' | 'setPose' | 'dispose'> & Partial<OfOneView>) | null;
  /** What tables, card and plots have cost: how often they were written, and the script's time for it, ms. */
  readonly numbers: { readonly writes: number; readonly scriptMs: number };
  readonly settings: Settings;
}

declare global {
  interface Window {
    posecast?: DebugApi;
  }
}

let link: RobotLink | null = null;
let scene: BodyView | null = null;

export function showLink(shown: RobotLink | null): void {
  link = shown;
}

export function showScene(shown: BodyView | null): void {
  scene = shown;
}

export function shownScene(): BodyView | null {
  return scene;
}

export function installDebugApi(): void {
  window.posecast = {
    get twin() {
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
        value: (field: string, label: string) => twin.value(field, label),
      };
    },
    get link() {
      if (link === null) return null;
      const { grantedHz, by } = link.client.link;
      return { granted_hz: grantedHz, carrier: by };
    },
    get scene() {
      return scene;
    },
    get numbers() {
      return cost;
    },
    get settings() {
      return settings();
    },
  };
}
