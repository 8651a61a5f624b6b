/** Where the parts of a robot lie. `pastUrl`: `…/robots/{robot}/past`. `view`: null: as the relay says. */
export interface LaneAddress {
  readonly pastUrl: string;
  readonly robot: string;
  readonly view: string | null;
}

const ADDRESS = /^(.*\/([^/]+)\/past)(?:\/([a-z0-9][a-z0-9-]{0,62}))?$/;

/** Reads where a lane lies. `lane`: the address of a robot's past, or, below it, of a view's. `streamUrl`: the stream whose relay
 *  has named it, relative to which it is read, and on whose origin and below whose robot it must lie; else null. */
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
