import { flagWords, formatClockSeconds } from '../twin/format.ts';
import { type RobotLink, useVersion } from './robot_link.ts';

/** What happened, newest first: the last hundred that the relay keeps. */
export function Alarms({ link }: { link: RobotLink }) {
  useVersion(link);
  const { events, schema } = link.twin;
  if (events.length === 0) return <p className="note">Nothing has happened yet.</p>;
  return (
    <ol className="alarms" data-testid="alarms">
      {events.toReversed().map((event) => (
        <li key={event.n} data-level={event.level} data-state={event.state}>
          <time>{event.at === null ? '—' : formatClockSeconds(event.at * 1000)}</time>
          <span className="alarm-mark" aria-hidden="true" />
          <span className="alarm-words">
            <b title={schema?.mapping.names.get(event.source)}>{event.source}</b> {flagWords(event.text)}
          </span>
          <span className="quiet">{event.state === 'off' ? 'cleared' : ''}</span>
        </li>
      ))}
    </ol>
  );
}
