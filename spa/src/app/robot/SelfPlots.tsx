import '../numbers/plots/plots.css';
import { useEffect, useRef, useState } from 'react';
import { arrangeTraces, TRACES_A_PAGE } from '../../twin/plots/choice.ts';
import type { Trace } from '../../twin/plots/trace.ts';
import { PlotStack } from '../numbers/plots/plot_stack.ts';
import { refreshWith } from '../shell/refresh.ts';
import { useTheme } from '../shell/theme.ts';
import { type RobotLink, useVersion } from '../state/robot_link.ts';
import { useSettings } from '../state/settings.ts';
import { useMore } from '../text/language.ts';

/** Plots are redrawn at least this often, because the time axis moves even without new frames. */
const SLIDES_EVERY_MS = 500;
/** After this long the plots are sorted once more: by then the history shows which values move. */
const CHOSEN_AGAIN_MS = 4000;

/** Plots of all values of a robot without a model, in pages, moving values first; and how to give the robot a model. */
export function SelfPlots({ link }: { link: RobotLink }) {
  const host = useRef<HTMLDivElement>(null);
  const traces = useArrangedTraces(link);
  const [page, setPage] = useState(0);
  const theme = useTheme();
  const { angle } = useSettings();
  const text = useMore();
  const { history } = link.minute;
  const pages = Math.max(1, Math.ceil(traces.length / TRACES_A_PAGE));
  const shown = Math.min(page, pages - 1);
  const first = shown * TRACES_A_PAGE;

  useEffect(() => {
    if (host.current === null) return;
    const list = traces.slice(first, first + TRACES_A_PAGE);
    const stack = new PlotStack(host.current, list, {
      theme,
      angle,
      words: text,
      derived: null,
      remove: null,
      zoomed: null,
    });
    const stop = refreshWith(link.twin, () => stack.write(history, link.nowMs()), [], SLIDES_EVERY_MS);
    return () => {
      stop();
      stack.dispose();
    };
  }, [link, history, traces, first, theme, angle, text]);

  return (
    <section className="self-plots" data-testid="self-plots" aria-label={text.ownPlots}>
      <p className="self-plots-say">
        {text.addBody}{' '}
        <code dir="ltr">
          posecast run … <span>--urdf FILE</span>
        </code>
      </p>
      <div className="plot-stack" ref={host} />
      {pages > 1 && (
        <nav className="self-plots-pages" aria-label={text.ownPlots}>
          <button
            type="button"
            className="icon-button"
            aria-label={text.previousPlots}
            disabled={shown === 0}
            onClick={() => setPage(shown - 1)}
          >
            ‹
          </button>
          <span className="quiet" data-testid="self-plots-page">
            {first + 1}–{Math.min(first + TRACES_A_PAGE, traces.length)} / {traces.length}
          </span>
          <button
            type="button"
            className="icon-button"
            data-testid="self-plots-next"
            aria-label={text.nextPlots}
            disabled={shown === pages - 1}
            onClick={() => setPage(shown + 1)}
          >
            ›
          </button>
        </nav>
      )}
    </section>
  );
}

/** All values that can be plotted, moving values first. They are sorted once at the start and once a little later; after that
 *  each plot keeps its place. */
function useArrangedTraces(link: RobotLink): readonly Trace[] {
  useVersion(link);
  const { schema } = link.twin;
  const { history } = link.minute;
  const [traces, setTraces] = useState<readonly Trace[]>([]);
  useEffect(() => {
    if (schema === null) return;
    const arrange = () => setTraces(arrangeTraces(history, link.nowMs()));
    arrange();
    const again = setTimeout(arrange, CHOSEN_AGAIN_MS);
    return () => clearTimeout(again);
  }, [history, schema, link]);
  return traces;
}
