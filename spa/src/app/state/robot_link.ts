import { useEffect, useState, useSyncExternalStore } from 'react';
import { fetchPartsAhead, setAway } from '../../browser/late_part.ts';
import { retryNow } from '../../browser/retry.ts';
import { perObject } from '../../kit.ts';
import type { PastState } from '../../past/past_types.ts';
import { laneUrl, leaveLane, manifestUrl, streamUrl, WANTED_HZ } from '../../relay/addresses.ts';
import { relayChoice } from '../../relay/relay.ts';
import type { RobotSigns } from '../../scene/signs/signs.ts';
import { isAbsent, type Link, StreamClient } from '../../stream/client.ts';
import { nowMs } from '../../stream/clock.ts';
import { isOld, type Word } from '../../twin/liveness.ts';
import { History } from '../../twin/plots/history.ts';
import { RobotTwin } from '../../twin/robot.ts';
import { LastReadings } from '../../twin/sensors/last_readings.ts';
import { FaultKeeper } from './fault_keeper.ts';
import { loadOwnLimits } from './limits.ts';
import { LivenessWatch, type Watch } from './liveness_watch.ts';
import { clearTraces, selectJoint } from './viewing.ts';

/** Records the last minute of a robot's values and the last readings of its sensors. It begins when the page opens, so
 *  that a card that is opened later can show the time before. */
export class HistoryKeeper {
  readonly history = new History();
  readonly readings = new LastReadings();
  /** Forgets the recorded values: the following data is from another time. */
  begin(): void {
    this.history.clear();
    this.readings.clear();
  }

  /** Stops recording. */
  readonly close: () => void;

  constructor(twin: RobotTwin) {
    this.close = twin.onState(() => {
      const { schema, state } = twin;
      if (schema === null || state === null) return;
      this.history.push(schema, state);
      this.readings.push(schema, state);
    });
  }
}

/** The connection that a robot's state comes over. */
export type Connection = Pick<StreamClient, 'link' | 'onChange' | 'wake' | 'wishAll' | 'rest'>;

/** Everything that the page keeps for one robot, present or past: its state, connection, word, faults and the preceding
 *  minute. */
export interface RobotLink {
  readonly twin: RobotTwin;
  readonly client: Connection;
  /** The address of the manifest of one of its models. */
  readonly manifestUrl: (modelHash: string) => string;
  readonly watch: Watch;
  readonly faults: FaultKeeper;
  readonly minute: HistoryKeeper;
  /** The states in the half minute after the shown moment, oldest first, as far as loaded; null while it shows the present. */
  readonly coming: (() => readonly PastState[]) | null;
  /** The time as of which the robot is shown, ms, on the clock of its states. */
  readonly nowMs: () => number;
  /** Whether that time is paused, so that each state is shown as it is. */
  readonly resting: () => boolean;
}

/** The signs on a robot's body; null while no body is shown. */
export const bodySigns = perObject((_: object): { signs: Pick<RobotSigns, 'drawn'> | null } => ({
  signs: null,
}));

/** Connects to a robot by its id while the component is shown, and disconnects when it is removed or the id changes. null
 *  before the first effect has run. `looksBack`: `usePast` will tell of earlier faults; until then, "No faults" may be false. */
export function useRobotLink(robot: string, looksBack: boolean): RobotLink | null {
  const [link, setLink] = useState<RobotLink | null>(null);
  useEffect(() => {
    const twin = new RobotTwin(robot, nowMs());
    loadOwnLimits(twin);
    const client = new StreamClient(twin, streamUrl(robot), WANTED_HZ, laneUrl(robot));
    const watch = new LivenessWatch(
      twin,
      () => client.wake(),
      (sinceMs) => client.doubt(sinceMs),
    );
    const faults = new FaultKeeper(twin, () => nowMs() - (client.link.behindMs ?? 0));
    if (looksBack && relayChoice().mirror === null) faults.expectPast();
    const minute = new HistoryKeeper(twin);
    const urlOf = (modelHash: string) => manifestUrl(robot, modelHash);
    const live = { coming: null, nowMs, resting: () => false };
    setLink({ twin, client, manifestUrl: urlOf, watch, faults, minute, ...live });
    watchNetwork(client, robot);
    return () => {
      client.close();
      watch.close();
      faults.close();
      minute.close();
      selectJoint(null);
      clearTraces();
      setLink(null);
    };
  }, [robot, looksBack]);
  return link;
}

/** When the stream opens, missing parts of the page are requested, and parts that may be needed later are prefetched. */
function watchNetwork(client: StreamClient, robot: string): void {
  let before: Link['phase'] | null = null;
  const look = () => {
    const { by, phase } = client.link;
    if (phase === before) return;
    before = phase;
    if (phase === 'waiting') setAway(!isAbsent(client.link)); // the relay itself has said that
    if (phase !== 'open') return;
    if (by !== 'segments') leaveLane(robot);
    setAway(false);
    retryNow();
    void fetchPartsAhead();
  };
  client.onChange(look);
  look();
}

/** The state of the connection to the relay. The component is drawn again when it changes. */
export function useConnection({ client }: RobotLink): Link {
  return useSyncExternalStore(client.onChange, () => client.link);
}

/** The delay of the stream's picture, ms; null: none. The component is redrawn when it changes. */
export function useBehindMs({ client }: RobotLink): number | null {
  return useSyncExternalStore(client.onChange, () => client.link.behindMs);
}

/** The robot's liveness in one word; null while nothing is known. The component is drawn again when it or its cause changes, in
 *  the same picture as every other one. */
export function useWord({ watch }: RobotLink): Word | null {
  useSyncExternalStore(watch.onWord, () => {
    const { word, cause } = watch.verdict();
    return `${word} ${cause}`;
  });
  return watch.word;
}

/** Whether the shown pose is out of date at the shown time. The component is redrawn when that changes. */
export function useIsOld({ watch }: RobotLink): boolean {
  return useSyncExternalStore(watch.onWord, () => isOld(watch.verdict()));
}

/** A counter that increases whenever anything about the robots changes, except their frames: schema, model, limits, info, events,
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

/** Whether the relay knows the robot. It has no past of a robot that it has not received since it started. */
export function isHeard({ client, twin }: RobotLink): boolean {
  return client.link.phase === 'open' && twin.schema !== null && twin.evidence.status?.seq != null;
}
