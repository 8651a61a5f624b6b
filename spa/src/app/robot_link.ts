import { useEffect, useState, useSyncExternalStore } from 'react';
import { type Link, StreamClient } from '../stream/client.ts';
import { nowMs } from '../stream/clock.ts';
import type { Word } from '../twin/liveness.ts';
import { RobotTwin } from '../twin/robot.ts';
import { LivenessWatch } from './watch.ts';

/** As often as the eye can use; the relay gives less when it must. */
const WANTED_HZ = 30;

/** One robot as this page has it: its state, the connection that feeds it, and the watch over its truth. */
export interface RobotLink {
  twin: RobotTwin;
  client: StreamClient;
  watch: LivenessWatch;
}

/** Where the relay is: the origin that served the page. */
export function apiUrl(path: string): string {
  return new URL(`api/v1/${path}`, window.location.href.split('#')[0]).href;
}

export function streamUrl(robot: string): string {
  return apiUrl(`robots/${robot}/live`).replace(/^http/, 'ws');
}

export function useRobotLink(robot: string): RobotLink | null {
  const [link, setLink] = useState<RobotLink | null>(null);
  useEffect(() => {
    const twin = new RobotTwin(robot, nowMs());
    const opened: RobotLink = {
      twin,
      client: new StreamClient(twin, streamUrl(robot), WANTED_HZ),
      watch: new LivenessWatch(twin),
    };
    setLink(opened);
    return () => {
      opened.client.close();
      opened.watch.close();
      setLink(null);
    };
  }, [robot]);
  return link;
}

export function useConnection({ client }: RobotLink): Link {
  return useSyncExternalStore(
    (listener) => client.onChange(listener),
    () => client.link,
  );
}

export function useWord({ watch }: RobotLink): Word | null {
  return useSyncExternalStore(watch.onWord, () => watch.word);
}

/** Changes whenever something slow about the robot did (schema, model, info, events). */
export function useVersion({ twin }: RobotLink): number {
  return useSyncExternalStore(
    (listener) => twin.onChange(listener),
    () => twin.version,
  );
}
