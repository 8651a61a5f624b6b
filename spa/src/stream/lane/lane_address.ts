/** The address of a robot's parts. `pastUrl`: `…/robots/{robot}/past`. `view`: null: as the relay says. */
export interface LaneAddress {
  readonly pastUrl: string;
  readonly robot: string;
  readonly view: string | null;
}

const ADDRESS = /^(.*\/([^/]+)\/past)(?:\/([a-z0-9][a-z0-9-]{0,62}))?$/;

/** Parses a lane's address. `lane`: the address of a robot's past or, below it, of a view's past. `streamUrl`: the stream whose
 *  relay named the lane, else null. The lane is then resolved relative to it, and must have its origin and lie below its robot's
 *  path. */
export function readLaneAddress(lane: string, streamUrl: string | undefined): LaneAddress | null {
  const base = streamUrl?.replace(/^ws/, 'http');
  try {
    const { origin, pathname } = new URL(lane, base);
    const [, pastUrl, robot, view] = ADDRESS.exec(origin + pathname) ?? [];
    if (pastUrl === undefined || robot === undefined) return null;
    if (base !== undefined && (view === undefined || pastUrl !== new URL('past', base).href)) return null;
    return { pastUrl, robot, view: view ?? null };
  } catch {
    return null;
  }
}
