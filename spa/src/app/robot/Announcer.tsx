import { useEffect, useState } from 'react';
import { asAnyone } from '../../relay/token.ts';
import type { ValueLimits } from '../../twin/limits.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { ImuTable } from '../../twin/sensors/imus.ts';
import { WrenchTable } from '../../twin/sensors/wrenches.ts';
import { BALANCE, mayTell } from '../balance/BalanceParts.tsx';
import type { RobotLink } from '../state/robot_link.ts';
import { useMore } from '../text/language.ts';
import { type Announcement, type AnnouncementInput, announcement } from './announcement.ts';

/** Least time between two announcements to screen readers. */
const EVERY_MS = 5000;
/** How often the announcement is rebuilt and compared with the previous one. */
const LOOK_MS = 500;

/** The sensors that announcements are about, whatever is drawn on the body. */
class Sensors {
  readonly #wrenches: WrenchTable;
  readonly #imus: ImuTable;

  constructor(readonly schema: NonNullable<RobotTwin['schema']>) {
    this.#wrenches = new WrenchTable(schema);
    this.#imus = new ImuTable(schema);
  }

  read(codes: Int32Array, limits: ValueLimits): AnnouncementInput['readings'] {
    this.#imus.read(codes);
    return { wrenches: this.#wrenches.read(codes, limits), body: this.#imus.body };
  }
}

/** The sentence about balance, and the coarser text that triggers a new announcement; null if there is none. */
function balance(link: RobotLink): Announcement | null {
  if (!mayTell(link)) return null;
  void BALANCE.load();
  return BALANCE.value()?.spokenStance(link) ?? null;
}

/** Announces the state of the robot to screen readers: when its gist changes, but at most every 5 s. */
export function Announcer({ link }: { link: RobotLink }) {
  const [said, setSaid] = useState('');
  useEffect(() => {
    let sensors: Sensors | null = null;
    let gist = '';
    let saidMs = Number.NEGATIVE_INFINITY;
    const look = () => {
      const { schema, state, limits, name } = link.twin;
      if (schema !== sensors?.schema) sensors = schema === null ? null : new Sensors(schema);
      const now = announcement({
        name,
        verdict: link.watch.verdict(),
        ending: link.client.link.ending,
        behindMs: link.client.link.behindMs,
        readings:
          sensors === null || state === null || limits === null ? null : sensors.read(state.codes, limits),
        faults: link.faults.faults() ?? [],
        balance: balance(link),
      });
      if (now.gist === gist || performance.now() - saidMs < EVERY_MS) return;
      gist = now.gist;
      saidMs = performance.now();
      setSaid(now.text);
    };
    const timer = setInterval(look, LOOK_MS);
    return () => clearInterval(timer);
  }, [link]);
  return (
    <>
      <AsAnyone />
      <p className="unseen" role="status" aria-live="polite" data-testid="spoken">
        {said}
      </p>
    </>
  );
}

/** A note that the page shows only what anyone may see, with a link to the same view with the viewer's own rights. Empty
 *  unless the address has `?as=anyone`. */
function AsAnyone() {
  const rest = useMore();
  if (!asAnyone()) return null;
  const { pathname, search, hash } = window.location;
  const without = new URLSearchParams(search);
  without.delete('as');
  return (
    <p className="as-anyone" role="status" data-testid="as-anyone">
      <span>{rest.seenAsAnyone}</span>
      <a className="text-button" href={`${pathname}${without.size > 0 ? `?${without}` : ''}${hash}`}>
        {rest.asYourself}
      </a>
    </p>
  );
}
