import { useEffect, useEffectEvent, useRef, useState } from 'react';
import './plots.css';
import type { History } from '../../../twin/plots/history.ts';
import { BALANCE_TRACES } from '../../balance/BalanceParts.tsx';
import { refreshWith } from '../../shell/refresh.ts';
import { useTheme } from '../../shell/theme.ts';
import type { RobotLink } from '../../state/robot_link.ts';
import { useSettings } from '../../state/settings.ts';
import { clearTraces, removeTrace, useTraces } from '../../state/viewing.ts';
import { say, useMore } from '../../text/language.ts';
import { PlotStack } from './plot_stack.ts';

/** Plots are redrawn this often even without new frames, because the time axis moves. */
const SLIDES_EVERY_MS = 500;

/** A paused minute. */
interface Held {
  readonly past: History;
  readonly atMs: number;
}

/** Plots of up to eight values over the last minute, which can be paused, read off at a cursor, and saved as CSV. */
export function Plots({ link }: { link: RobotLink }) {
  const host = useRef<HTMLDivElement>(null);
  const stack = useRef<PlotStack | null>(null);
  const list = useTraces();
  const theme = useTheme();
  const { angle } = useSettings();
  const text = useMore();
  const [held, setHeld] = useState<Held | null>(null);
  const { history } = link.minute;

  const write = useEffectEvent((made: PlotStack, anew = true) => {
    if (held === null) made.write(history, link.nowMs());
    else if (anew || made.computing) made.write(held.past, held.atMs);
  });
  useEffect(() => {
    if (host.current === null || list.length === 0) return;
    const made = new PlotStack(host.current, list, {
      theme,
      angle,
      words: text,
      derived: BALANCE_TRACES.value()?.balanceTraces(link) ?? null, // whoever plots a value has opened the numbers
      remove: removeTrace,
      zoomed: () => setHeld((before) => before ?? hold(history, link.nowMs())),
    });
    stack.current = made;
    write(made);
    const stop = refreshWith(link.twin, () => write(made, false), [], SLIDES_EVERY_MS);
    return () => {
      stop();
      stack.current = null;
      made.dispose();
    };
  }, [link, history, list, theme, angle, text]);

  if (list.length === 0) {
    return (
      <p className="note" data-testid="no-plots">
        {text.nothingPlotted}
      </p>
    );
  }
  const csv = () => {
    if (stack.current !== null) save(`${link.twin.robot}.csv`, stack.current.csv());
  };
  return (
    <section className="plots" data-testid="plots" data-paused={held !== null} aria-label={say().plots}>
      <div className="plot-tools">
        <button
          type="button"
          className="text-button"
          data-testid="plot-pause"
          onClick={() => setHeld(held === null ? hold(history, link.nowMs()) : null)}
        >
          {held === null ? text.pause : text.goOn}
        </button>
        <span className="quiet">{held === null ? '' : text.lookCloser}</span>
        <span className="grow" />
        <button type="button" className="text-button" data-testid="plot-csv" onClick={csv}>
          CSV
        </button>
        <button type="button" className="text-button" onClick={clearTraces}>
          {text.clear}
        </button>
      </div>
      <div className="plot-stack" ref={host} />
    </section>
  );
}

function hold(history: History, atMs: number): Held {
  return { past: history.copy(), atMs };
}

function save(name: string, csv: string): void {
  const url = URL.createObjectURL(new Blob([csv], { type: 'text/csv' }));
  const link = document.createElement('a');
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000); // the download has started by then
}
