import './past.css';
import { memo, useId } from 'react';
import type { Mark, Span, Timeline } from '../../../past/past_types.ts';
import { movementPath } from './movement.ts';
import type { Tick } from './ticks.ts';
import { contains, msPerPx, pxAt, textPxOf, type View } from './track_view.ts';

/** The top of the curve within the track's height, CSS px. In the open track, the playhead's time has a row above it. */
const TOP_PX = { open: 22, slim: 4 } as const;

const MARK_PX = 5.4;
/** A number in place of several marks. */
const COUNT_PX = { height: 13, around: 8, digit: 6.4, half: 11 } as const;
/** The width that a label over a span needs, and the minimum width of a repeated span. */
const LEAST_PX = { word: 60, loop: 12 } as const;

/** The parts of the track that move only with the time: movement, words, loop, ticks and marks. */
export const TrackPicture = memo(function TrackPicture({
  timeline,
  view,
  ticks,
  heightPx,
  open,
  loop,
}: {
  timeline: Timeline;
  view: View;
  ticks: readonly Tick[];
  heightPx: number;
  open: boolean;
  loop: Span | null;
}) {
  const id = useId();
  const topPx = TOP_PX[open ? 'open' : 'slim'];
  const textPx = textPxOf(heightPx, open);
  const basePx = Math.max(topPx, heightPx - textPx - 5);
  const mostBytesPerS = timeline.movement.reduce((most, { bytesPerS }) => Math.max(most, bytesPerS), 1);
  const path = movementPath(timeline.movement, view, { basePx, heightPx: basePx - topPx, mostBytesPerS });
  const words = drawnWords(timeline.words, view);
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
      {timeline.unknown
        ?.filter(({ fromMs, toMs }) => toMs > view.fromMs && fromMs < view.toMs)
        .map((day) => (
          <path
            key={day.fromMs}
            className="track-unknown"
            d={`M${between(day).x} ${(topPx + basePx) / 2}h${between(day).width}`}
          />
        ))}
      {loop !== null && <Loop {...widened(between(loop))} topPx={topPx} basePx={basePx} />}
      <path className="track-base" d={`M${between(view).x} ${basePx + 0.5}h${between(view).width}`} />
      <Ticks {...{ view, ticks, basePx, textPx }} />
      {open &&
        words.map((span) => {
          const { x, width } = between(span);
          return width < LEAST_PX.word ? null : (
            <text key={span.fromMs} className="track-said" x={x + width / 2} y={(topPx + basePx) / 2 + 4}>
              {span.word === 'silent' ? 'STALE' : 'OFFLINE'}
            </text>
          );
        })}
      {drawnMarks(timeline.marks, view).map(({ xPx, level, exact, count }) => (
        <g
          key={`${level} ${xPx}`}
          className="track-mark"
          data-level={level}
          data-exact={exact}
          transform={`translate(${inside(xPx, count, view.widthPx).toFixed(1)} ${topPx + MARK_PX + 1})`}
        >
          {exact && <path className="track-stem" d={`M0 0V${basePx - topPx - MARK_PX - 1}`} />}
          {level === 'fault' && count > 1 ? (
            <Count count={count} />
          ) : (
            <path d={level === 'fault' ? OCTAGON : TRIANGLE} />
          )}
        </g>
      ))}
    </svg>
  );
});

/** Marks of one kind nearer than this are merged, CSS px; the second value is for marks with a number, which are wider. */
const TOGETHER_PX = { mark: 12, count: 24 } as const;

/** The spans to draw: of those that end within a quarter of a px of one another, the first. */
export function drawnWords(words: Timeline['words'], view: View): Timeline['words'] {
  const leastMs = msPerPx(view) / 4;
  let drawnToMs = Number.NEGATIVE_INFINITY;
  return words.filter(({ fromMs, toMs }) => {
    if (toMs <= view.fromMs || fromMs >= view.toMs || toMs - drawnToMs < leastMs) return false;
    drawnToMs = toMs;
    return true;
  });
}

export interface DrawnMark {
  readonly xPx: number;
  readonly level: Mark['level'];
  readonly exact: boolean;
  /** How many it stands for. */
  readonly count: number;
}

/** The marks to draw, cautions first, so that faults lie on top. */
export function drawnMarks(marks: readonly Mark[], view: View): DrawnMark[] {
  const drawn: DrawnMark[] = [];
  for (const level of ['caution', 'fault'] as const) {
    let last: DrawnMark | undefined;
    for (const mark of marks) {
      if (mark.level !== level || !contains(view, mark.atMs)) continue;
      const xPx = pxAt(view, mark.atMs);
      const { count = 1 } = mark;
      const besidePx = TOGETHER_PX[level === 'fault' && (last?.count ?? 1) > 1 ? 'count' : 'mark'];
      if (last !== undefined && xPx - last.xPx < besidePx) {
        last = { ...last, exact: last.exact || mark.exact, count: last.count + count };
        drawn.pop();
      } else last = { xPx, level, exact: mark.exact, count };
      drawn.push(last);
    }
  }
  return drawn;
}

const OCTAGON = octagon(MARK_PX);
const TRIANGLE = `M0 ${-MARK_PX}L${MARK_PX} ${MARK_PX - 0.5}H${-MARK_PX}Z`;

function octagon(r: number): string {
  const s = 0.414 * r;
  return `M${-s} ${-r}H${s}L${r} ${-s}V${s}L${s} ${r}H${-s}L${-r} ${s}V${-s}Z`;
}

/** How many faults started here, if there is no room for a mark each. */
function Count({ count }: { count: number }) {
  const words = count > 99 ? '99+' : String(count);
  const { height, around, digit } = COUNT_PX;
  const width = around + digit * words.length;
  return (
    <>
      <rect x={-width / 2} y={-height / 2} width={width} height={height} rx="4" />
      <text className="track-count" y="3.8">
        {words}
      </text>
    </>
  );
}

/** A number is not cut at an end of the line. */
function inside(xPx: number, count: number, widthPx: number): number {
  const half = count > 1 ? COUNT_PX.half : 0;
  return Math.max(half, Math.min(widthPx - half, xPx));
}

/** A span of seconds stays visible on a line of hours. */
function widened({ x, width }: { x: number; width: number }) {
  const more = Math.max(0, LEAST_PX.loop - width);
  return { x: x - more / 2, width: width + more };
}

function Hatch({ id, path }: { id: string; path: string }) {
  return (
    <pattern id={id} width="6" height="6" patternUnits="userSpaceOnUse">
      <path className="track-hatch" d={path} />
    </pattern>
  );
}

/** The repeated span, with a handle at either end. */
function Loop({ x, width, topPx, basePx }: { x: number; width: number; topPx: number; basePx: number }) {
  const height = Math.max(0, basePx - topPx);
  return (
    <g className="track-loop" data-testid="loop">
      <rect x={x} y={topPx} width={width} height={height} />
      <path d={`M${x + 4} ${topPx}H${x}v${height}h4M${x + width - 4} ${topPx}h4v${height}h-4`} />
    </g>
  );
}

function Ticks({
  view,
  ticks,
  basePx,
  textPx,
}: {
  view: View;
  ticks: readonly Tick[];
  basePx: number;
  textPx: number;
}) {
  let path = '';
  for (const { atMs, label } of ticks)
    path += `M${Math.round(pxAt(view, atMs)) + 0.5} ${basePx}v${label === null ? 3 : 4}`;
  return (
    <g className="track-ticks" style={{ fontSize: textPx }}>
      <path d={path} />
      {ticks.map(({ atMs, label }) =>
        label === null ? null : (
          <text key={atMs} data-day={!/^\d\d:/.test(label)} x={pxAt(view, atMs)} y={basePx + textPx + 1}>
            {label}
          </text>
        ),
      )}
    </g>
  );
}
