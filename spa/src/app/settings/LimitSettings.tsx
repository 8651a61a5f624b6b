import '../shell/styles/signs.css';
import { useEffect, useId, useRef, useState } from 'react';
import { type LimitChannel, limitChannels } from '../../twin/alarms/limit_channels.ts';
import { MARGIN } from '../../twin/balance/stance.ts';
import { displayOf } from '../../twin/format.ts';
import { ANY, type BadThreshold, type Threshold, whyNoThreshold } from '../../twin/limits.ts';
import { BALANCE, mayTell } from '../balance/BalanceParts.tsx';
import { dropOwnLimits, setOwnLimit } from '../state/limits.ts';
import { type RobotLink, useVersion } from '../state/robot_link.ts';
import { more, useMore } from '../text/language.ts';
import { useBalanceText } from '../text/late.ts';

/** How often the mark at the present value is moved. */
const LIVE_EVERY_MS = 250;

/** The limits of a robot in groups of channels. Each limit can be set with a slider or as a number; the viewer's limit replaces
 *  the profile's. Empty before there is a schema, and without such channels. */
export function LimitSettings({ link }: { link: RobotLink }) {
  useVersion(link);
  const text = useMore();
  const ofBalance = useBalanceText();
  const { twin } = link;
  const { schema } = twin;
  if (schema === null) return null;
  const groups = limitChannels(schema, text, mayTell(link) ? ofBalance : null);
  if (groups.length === 0) return null;
  return (
    <section className="limits" data-testid="limits">
      <header>
        <h3>{text.limitsOf(twin.name)}</h3>
        {twin.edits.size > 0 && (
          <button type="button" className="text-button" onClick={() => dropOwnLimits(twin)}>
            {text.allAsProfile}
          </button>
        )}
      </header>
      {groups.map(({ title, channels, note }) => (
        <details key={title}>
          <summary>
            {title}
            {channels.some(({ field, label }) => twin.limits?.edited(field, label)) && (
              <i className="edited">{text.yoursNow}</i>
            )}
          </summary>
          {channels.map((channel) => (
            <Limit key={`${channel.field} ${channel.label}`} link={link} channel={channel} />
          ))}
          {note !== undefined && <p className="quiet">{note}</p>}
        </details>
      ))}
    </section>
  );
}

function Limit({ link, channel }: { link: RobotLink; channel: LimitChannel }) {
  const text = useMore();
  const { twin } = link;
  const { field, label, name, unit, span } = channel;
  const threshold = twin.limits?.threshold(field, label) ?? { low: null, high: null, caution: 1 };
  const edited = twin.limits?.edited(field, label) ?? false;
  const [why, setWhy] = useState<BadThreshold | null>(null);
  const set = (part: Partial<Threshold>) => {
    const wanted = { ...threshold, ...part };
    const problem = whyNoThreshold(wanted);
    setWhy(problem);
    if (problem === null) setOwnLimit(twin, field, label, wanted);
  };
  const { unit: shownUnit } = displayOf(unit, 'rad');
  const id = `${field}-${label}`;
  return (
    <fieldset className="limit" data-testid={`limit-${id}`} data-edited={edited}>
      <legend>
        {name} <span className="unit">{shownUnit}</span>
      </legend>
      <Track channel={channel} link={link} threshold={threshold} onChange={set} />
      <div className="limit-numbers">
        <NumberField
          text={text.low}
          value={threshold.low}
          step={span / 100}
          onChange={(low) => set({ low })}
        />
        <NumberField
          text={text.high}
          value={threshold.high}
          step={span / 100}
          onChange={(high) => set({ high })}
        />
        <NumberField
          text={text.cautionFrom}
          value={Math.round(threshold.caution * 100)}
          step={5}
          onChange={(percent) => set({ caution: (percent ?? 100) / 100 })}
        />
        {edited && (
          <button
            type="button"
            className="text-button"
            onClick={() => {
              setWhy(null);
              setOwnLimit(twin, field, label, null);
            }}
          >
            {text.asProfile}
          </button>
        )}
      </div>
      {why !== null && (
        <p className="limit-why" role="alert">
          {text[why]}
        </p>
      )}
    </fieldset>
  );
}

/** A bar coloured by the limits (green, yellow, red), with a slider at each limit and a mark at the present value. */
function Track(props: {
  channel: LimitChannel;
  link: RobotLink;
  threshold: Threshold;
  onChange: (part: Partial<Threshold>) => void;
}) {
  const { field, label, span } = props.channel;
  const { low, high, caution } = props.threshold;
  const mark = useRef<HTMLElement>(null);
  const { link } = props;
  const { twin } = link;
  useEffect(() => {
    if (label === ANY) return;
    const write = () => {
      const value = twin.value(field, label) ?? computed(link, field);
      if (mark.current === null) return;
      mark.current.hidden = value === null;
      if (value !== null) mark.current.style.left = `${place(value, span) * 100}%`;
    };
    write();
    const timer = setInterval(write, LIVE_EVERY_MS);
    return () => clearInterval(timer);
  }, [link, twin, field, label, span]);
  const towardsRest = (limit: number, side: number) =>
    limit * side >= 0 ? limit * caution : limit / caution;
  const at = (value: number) => `${(place(value, span) * 100).toFixed(1)}%`;
  const stops: string[] = [];
  if (low !== null) {
    stops.push(`var(--fault) ${at(low)}`, `var(--caution) ${at(low)} ${at(towardsRest(low, -1))}`);
  }
  stops.push(`var(--live) ${low === null ? '0%' : at(towardsRest(low, -1))}`);
  stops.push(`var(--live) ${high === null ? '100%' : at(towardsRest(high, 1))}`);
  if (high !== null) {
    stops.push(`var(--caution) ${at(towardsRest(high, 1))} ${at(high)}`, `var(--fault) ${at(high)}`);
  }
  const range = { min: -span, max: span, step: span / 200 };
  return (
    <div className="limit-track" style={{ backgroundImage: `linear-gradient(90deg, ${stops.join(', ')})` }}>
      {low !== null && (
        <input
          type="range"
          aria-label={more().lowerLimit}
          {...range}
          value={low}
          onChange={(event) => props.onChange({ low: Number(event.target.value) })}
        />
      )}
      {high !== null && (
        <input
          type="range"
          aria-label={more().upperLimit}
          {...range}
          value={high}
          onChange={(event) => props.onChange({ high: Number(event.target.value) })}
        />
      )}
      <i className="limit-now" ref={mark} hidden />
    </div>
  );
}

/** The newest value if the page computes it; null otherwise, and while there is none. */
function computed(link: RobotLink, field: string): number | null {
  if (field !== MARGIN.field) return null;
  return BALANCE.value()?.balanceOf(link).known()?.stance?.marginMm ?? null;
}

/** A text field for a number; empty means no limit (null). Invalid text changes nothing. */
function NumberField(props: {
  text: string;
  value: number | null;
  step: number;
  onChange: (value: number | null) => void;
}) {
  const id = useId();
  const shown = props.value === null ? '' : String(Number(props.value.toFixed(2)));
  const [typed, setTyped] = useState<string | null>(null);
  return (
    <span className="number-field">
      <label htmlFor={id}>{props.text}</label>
      <input
        id={id}
        type="text"
        inputMode="decimal"
        size={6}
        value={typed ?? shown}
        onChange={(event) => {
          const { value } = event.target;
          setTyped(value);
          const number = Number(value.replace(',', '.').replace('\u2212', '-'));
          if (value.trim() === '') props.onChange(null);
          else if (Number.isFinite(number)) props.onChange(number);
        }}
        onBlur={() => setTyped(null)}
      />
    </span>
  );
}

function place(value: number, span: number): number {
  return Math.min(1, Math.max(0, (value + span) / (2 * span)));
}
