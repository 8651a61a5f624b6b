import type { RobotScene } from '../scene/index.ts';
import type { RobotLink } from './robot_link.ts';
import type { Settings } from './settings.ts';
import { settings } from './settings.ts';

/** What tests and curious people find under `window.posecast`: the page as it is, read only. */
interface Handle {
  readonly twin: {
    readonly seq: number | null;
    readonly t_s: number | null;
    readonly liveness: string | null;
    readonly cause: string | null;
    value(field: string, label: string): number | null | undefined;
  } | null;
  readonly scene: Pick<
    RobotScene,
    'linkPoses' | 'renderedFrames' | 'drawCalls' | 'triangles' | 'pick' | 'setLinkLook'
  > | null;
  readonly settings: Settings;
}

declare global {
  interface Window {
    posecast?: Handle;
  }
}

let link: RobotLink | null = null;
let scene: RobotScene | null = null;

export function showLink(shown: RobotLink | null): void {
  link = shown;
}

export function showScene(shown: RobotScene | null): void {
  scene = shown;
}

export function installHandle(): void {
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
    get scene() {
      return scene;
    },
    get settings() {
      return settings();
    },
  };
}
