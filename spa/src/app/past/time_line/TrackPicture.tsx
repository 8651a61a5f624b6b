import { memo, useId } from 'react';
import type { Span, Timeline } from '../../../past/past_types.ts';
import { formatClock, formatClockSeconds } from '../../../twin/format.ts';
import { drawnMarks } from './marks.ts';
import { movementPath } from './movement.ts';
import { pxAt, ticksOf, type View } from './track_view.ts';

/** Where things lie in the track's height, CSS px. Open, the playhead's time has a row above the curve and the ticks' times
 *  have one below it. */
export const OPEN = { topPx: 22, belowPx: 16 } as const;
const SLIM = { topPx: 6, belowPx: 6 } as const;

const MARK_PX = 5.4;
/** Half a label's width, and what a word over a span needs. */
const LABEL_PX = { clock: 17, seconds: 26, word: 60 } as const;

/** What lies on the track and moves only with the time: movement, words, loop, ticks and marks. */
export const TrackPicture = memo(function TrackPicture({
  timeline,
  view,
  heightPx,
  open,
  loop,
}: {
  timeline: Timeline;
  view: View;
  heightPx: number;
  open: boolean;
  loop: Span | null;
}) {
  const id = useId();
  const { topPx, belowPx } = open ? OPEN : SLIM;
  const basePx = Math.max(topPx, heightPx - belowPx);
  const mostBytesPerS = timeline.movement.reduce((most, { bytesPerS }) => Math.max(most, bytesPerS), 1);
  const path = movementPath(timeline.movement, view, { basePx, heightPx: basePx - topPx, mostBytesPerS });
  const words = timeline.words.filter(({ fromMs, toMs }) => toMs > view.fromMs && fromMs < view.toMs);
  const between = (span: Span) => {
    const fromPx = pxAt(view, Math.max(view.fromMs, span.fromMs));
    return { x: fromPx, width: Math.max(1.5, pxAt(view, Math.min(view.toMs, span.toMs)) - fromPx) };
  };
  return (
    <svg className="track-picture" width={view.widthPx} height={heightPx} aria-hidden="true">
      <defs>
        <Hatch id={`${id}silent`} path="M-1 7L7 -1M-1 1L1 -1M5 7L7 5" />
        <Hatch id={`${id}offline`} path="M0 0L6 6M0 6L6 0" />
        <clipPath id={`${id}clip`}>
          <rect {...between(view)} height={heightPx} />
        </clipPath>
      </defs>
      <g clipPath={`url(#${id}clip)`}>
        <path className="track-movement" d={path} />
        {words.map((span) => (
          <g key={`${span.word} ${span.fromMs}`} className="track-word" data-word={span.word}>
            <rect
              {...between(span)}
              y={topPx}
              height={Math.max(0, basePx - topPx)}
              fill={`url(#${id}${span.word})`}
            />
          </g>
        ))}
      </g>
      {loop !== null && <Loop {...between(loop)} topPx={topPx} basePx={basePx} />}
      <path className="track-base" d={`M${between(view).x} ${basePx + 0.5}h${between(view).width}`} />
      <Ticks view={view} basePx={basePx} labels={open} />
      {open &&
        words.map((span) => {
          const { x, width } = between(span);
          return width < LABEL_PX.word ? null : (
            <text key={span.fromMs} className="track-said" x={x + width / 2} y={(topPx + basePx) / 2 + 4}>
              {span.word === 'silent' ? 'STALE' : 'OFFLINE'}
            </text>
          );
        })}
      {drawnMarks(timeline.marks, view).map(({ xPx, level, exact }) => (
        <g
          key={`${level} ${xPx}`}
          className="track-mark"
          data-level={level}
          data-exact={exact}
          transform={`translate(${xPx.toFixed(1)} ${topPx + MARK_PX + 1})`}
        >
          {exact && <path className="track-stem" d={`M0 0V${basePx - topPx - MARK_PX - 1}`} />}
          <path d={level === 'fault' ? OCTAGON : TRIANGLE} />
        </g>
      ))}
    </svg>
  );
});

const OCTAGON = octagon(MARK_PX);
const TRIANGLE = `M0 ${-MARK_PX}L${MARK_PX} ${MARK_PX - 0.5}H${-MARK_PX}Z`;

function octagon(r: number): string {
  const s = 0.414 * r;
  return `M${-s} ${-r}H${s}L${r} ${-s}V${s}L${s} ${r}H${-s}L${-r} ${s}V${-s}Z`;
}

function Hatch({ id, path }: { id: string; path: string }) {
  return (
    <pattern id={id} width="6" height="6" patternUnits="userSpaceOnUse">
      <path className="track-hatch" d={path} />
    </pattern>
  );
}

/** The span that is repeated, with an end to take hold of at either side. */
function Loop({ x, width, topPx, basePx }: { x: number; width: number; topPx: number; basePx: number }) {
  const height = Math.max(0, basePx - topPx);
  return (
    <g className="track-loop" data-testid="loop">
      <rect x={x} y={topPx} width={width} height={height} />
      <path d={`M${x + 4} ${topPx}H${x}v${height}h4M${x + width - 4} ${topPx}h4v${height}h-4`} />
    </g>
  );
}

function Ticks({ view, basePx, labels }: { view: View; basePx: number; labels: boolean }) {
  const offsetMs = -new Date(view.toMs).getTimezoneOffset() * 60_000;
  const { ticks, labelS } = ticksOf(view, offsetMs);
  const write = labelS < 60 ? formatClockSeconds : formatClock;
  const halfPx = labelS < 60 ? LABEL_PX.seconds : LABEL_PX.clock;
  let path = '';
  for (const { atMs, labelled } of ticks)
    path += `M${Math.round(pxAt(view, atMs)) + 0.5} ${basePx}v${labelled && labels ? 5 : 3}`;
  const written = labels ? ticks.filter(({ labelled }) => labelled) : [];
  return (
    <g className="track-ticks">
      <path d={path} />
      {written.map(({ atMs }) => {
        const x = pxAt(view, atMs);
        if (x < halfPx || x > view.widthPx - halfPx) return null;
        return (
          <text key={atMs} x={x} y={basePx + 14.5}>
            {write(atMs)}
          </text>
        );
      })}
    </g>
  );
}
