import { laneUrl } from '../../relay/addresses.ts';
import type { Link } from '../../stream/client.ts';
import { formatSpan } from '../../twin/format.ts';
import { isClaim, type Verdict } from '../../twin/liveness.ts';
import { isolated } from '../../twin/names.ts';
import { useCatalogue } from '../explain/catalogue.ts';
import { type RobotLink, useConnection } from '../state/robot_link.ts';
import { more, say, useMore } from '../text/language.ts';
import { behindSpan, endingWords } from '../words/status.ts';

/** The explanation that the chip opens: the reason for the state, and what to do about a lowered rate. */
export function Explanation({ link }: { link: RobotLink }) {
  const connection = useConnection(link);
  const text = useMore();
  const catalogue = useCatalogue();
  const verdict = link.watch.verdict();
  const isBehind = connection.behindMs !== null && isClaim(verdict.word);
  const told = catalogue?.words[isBehind ? 'BEHIND' : (verdict.word ?? '')];
  const isLaneChosen = laneUrl(link.twin.robot) !== null;
  return (
    <>
      {explanationWords(verdict, connection, isLaneChosen).map((line, i) => (
        <p key={i === 0 ? 'first' : line.split(':')[0]}>{line}</p>
      ))}
      {told !== undefined && (
        <p>
          {told.what} {told.how}
        </p>
      )}
      {connection.rateReason !== null && connection.phase === 'open' && (
        <button
          type="button"
          className="text-button"
          data-testid="wish-all"
          onClick={() => link.client.wishAll()}
        >
          {text.askAll}
        </button>
      )}
    </>
  );
}

/** The lines of the explanation that the state chip opens: the state first, then the connection. `isLaneChosen`: the page reads
 *  segments because it is configured to, not because the relay is full. */
export function explanationWords(verdict: Verdict, link: Link, isLaneChosen = false): string[] {
  const text = more();
  const unwritten = link.by === 'mirror' && verdict.cause === 'relay degraded';
  const lines = [unwritten ? text.explainUnwritten : stateWords(verdict, link)];
  if (verdict.word === 'RECORDED') return lines; // there is no relay
  if (verdict.overShare) lines.push(text.explainOverShare);
  if (link.behindMs !== null) lines.push(whyBehind(link.by, link.behindMs, isLaneChosen));
  if (link.by !== 'segments')
    // a cache may answer instead of the relay
    lines.push(verdict.linkMs === null ? text.notHeardYet : text.lastHeard(formatSpan(verdict.linkMs)));
  if (link.by === 'events' && link.phase === 'open') lines.push(text.explainEvents);
  if (link.by === 'mirror') lines.push(text.explainMirror);
  if (link.roundTripMs !== null) lines.push(text.roundTrip(formatSpan(link.roundTripMs)));
  if (link.rateReason !== null && link.grantedHz !== null) {
    lines.push(`${Math.round(link.grantedHz)} Hz: ${rateWords(link.rateReason)}.`);
  }
  return lines;
}

function stateWords({ word, cause, unchangedMs }: Verdict, { ending }: Link): string {
  const text = more();
  switch (word) {
    case null:
      return text.connectingToRelay;
    case 'LIVE':
      return text.posesComing;
    case 'HOLDING':
      return text.holdsStill(formatSpan(unchangedMs ?? 0));
    case 'STALE':
      if (cause === 'robot silent') return text.explainSilent;
      if (cause === 'slow network') return text.explainSlow;
      if (cause === 'busy browser') return text.explainBusy;
      if (cause === 'no connection' && ending !== null) return endingWords(ending);
      if (cause === 'waiting for the next part') return text.explainNextPart;
      return cause === 'relay degraded' ? text.explainDegraded : text.explainLost;
    case 'OFFLINE':
      return text.explainOffline;
    case 'PAST':
      return text.explainPast;
    case 'RECORDED':
      return text.explainRecorded;
  }
}

function whyBehind(by: Link['by'], behindMs: number, isLaneChosen: boolean): string {
  const { explainDelayed, explainCached, explainFull } = more();
  const say = by !== 'segments' ? explainDelayed : isLaneChosen ? explainCached : explainFull;
  return say(behindSpan(behindMs));
}

function rateWords(reason: string): string {
  if (reason === 'slow network') return say().slowNetwork;
  return reason === 'overload' ? more().overload : isolated(reason);
}
