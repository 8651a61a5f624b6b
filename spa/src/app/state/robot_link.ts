import { useEffect, useState, useSyncExternalStore } from 'react';
import { fetchPartsAhead, setAway } from '../../browser/late_part.ts';
import { retryNow } from '../../browser/retry.ts';
import { streamUrl, WANTED_HZ } from '../../relay/addresses.ts';
import { type Link, StreamClient } from '../../stream/client.ts';
import { nowMs } from '../../stream/clock.ts';
import type { Word } from '../../twin/liveness.ts';
import { RobotTwin } from '../../twin/robot.ts';
import { FaultKeeper } from './fault_keeper.ts';
import { HistoryKeeper } from './history_keeper.ts';
import { LivenessWatch } from './liveness_watch.ts';
import { loadOwnLimits } from './own_limits.ts';
import { selectJoint } from './selection.ts';
import { clearTraces } from './traces.ts';

/** All that the page keeps for one robot: its state, connection, liveness watch, faults and last minute. */
export interface RobotLink {
  twin: RobotTwin;
  client: StreamClient;
  watch: LivenessWatch;
  faults: FaultKeeper;
  past: HistoryKeeper;
}

/** Connects to a robot by its id while the component is shown, and disconnects when it is removed or the id changes. null
 *  before the first effect has run. */
export function useRobotLink(robot: string): RobotLink | null {
  const [link, setLink] = useState<RobotLink | null>(null);
  useEffect(() => {
    const twin = new RobotTwin(robot, nowMs());
    loadOwnLimits(twin);
    const client = new StreamClient(twin, streamUrl(robot), WANTED_HZ);
    const opened: RobotLink = {
      twin,
      client,
      watch: new LivenessWatch(twin, () => client.wake()),
      faults: new FaultKeeper(twin),
      past: new HistoryKeeper(twin),
    };
    setLink(opened);
    watchNetwork(client);
    return () => {
      opened.client.close();
      opened.watch.close();
      opened.faults.close();
      opened.past.close();
      selectJoint(null);
      clearTraces();
      setLink(null);
    };
  }, [robot]);
  return link;
}

/** What the page still lacks is asked for when the stream opens, and what it may need later is fetched then. */
function watchNetwork(client: StreamClient): void {
  let before: Link['phase'] | null = null;
  const look = () => {
    const { phase } = client.link;
    if (phase === before) return;
    before = phase;
    if (phase === 'waiting') setAway(true);
    if (phase !== 'open') return;
    setAway(false);
    retryNow();
    void fetchPartsAhead();
  };
  client.onChange(look);
  look();
}

/** The state of the connection to the relay. The component is drawn again when it changes. */
export function useConnection({ client }: RobotLink): Link {
  return useSyncExternalStore(
    (listener) => client.onChange(listener),
    () => client.link,
  );
}

/** The robot's liveness in one word; null while nothing is known. The component is drawn again when it changes. */
export function useWord({ watch }: RobotLink): Word | null {
  return useSyncExternalStore(watch.onWord, () => watch.word);
}

/** A number that grows whenever anything about the robots but their frames changes: schema, model, limits, info, events,
 *  connection. The component is drawn again then. */
export function useVersion(...links: readonly RobotLink[]): number {
  return useSyncExternalStore(
    (listener) => {
      const leave = links.map(({ twin }) => twin.onChange(listener));
      return () => {
        for (const off of leave) off();
      };
    },
    () => links.reduce((sum, { twin }) => sum + twin.version, 0),
  );
}
