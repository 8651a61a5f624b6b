import '../shell/styles/signs.css';
import { Load, type LoadScale } from '../../scene/signs/load.ts';
import type { RobotSigns } from '../../scene/signs/signs.ts';
import { displayOf, formatNumber } from '../../twin/format.ts';
import { Tucked } from '../shell/Tucked.tsx';
import { useTicked } from '../state/hooks.ts';
import { useSettings } from '../state/settings.ts';
import { useMore } from '../text/language.ts';

/** The legend of the load colours of one or several robots; empty while they are off. */
export function LoadLegend({ signs }: { signs: readonly RobotSigns[] }) {
  const { load } = useSettings();
  const text = useMore();
  // without limits, the scale adapts to the readings
  const scale = useTicked(1000, () =>
    load === 'off' ? null : scaleOf(signs.map((of) => of.of(Load)?.scale ?? null)),
  );
  if (scale === null) return null;
  const { field, unit, rest, full, limited, cautionPart } = scale;
  const display = displayOf(unit, 'rad');
  const said = (value: number) =>
    `${formatNumber(value, { ...display, decimals: Math.abs(value) < 10 ? 1 : 0 }).trim()} ${display.unit}`;
  const name = field === 'cur' ? text.motorCurrent : text.temperature;
  const most = full === null ? text.limit : said(full);
  return (
    <Tucked
      className="stage-legend"
      label={name}
      brief={
        <>
          <span>{most}</span>
          <i className="load-bar" />
          <span>{said(rest)}</span>
        </>
      }
    >
      <figure className="load-legend" data-testid="load-legend">
        <figcaption>
          <button type="button" className="term" data-explain="signs.load" aria-haspopup="dialog">
            {name}
          </button>
        </figcaption>
        <div className="load-scale">
          {cautionPart !== null && cautionPart > 0 && cautionPart < 1 && (
            <i
              className="load-caution"
              style={{ left: `${cautionPart * 100}%` }}
              title={text.cautionStarts}
            />
          )}
        </div>
        <div className="load-ends">
          <span>{said(rest)}</span>
          <span>{most}</span>
        </div>
        <p>
          <i className="load-over" /> {limited ? text.pastLimit : text.noLimitKnown}
        </p>
        <p>
          <i className="load-none" /> {text.noReading}
        </p>
      </figure>
    </Tucked>
  );
}

/** The common scale of several robots; if their limits differ, it is relative to each one's own limit. */
function scaleOf(scales: readonly (LoadScale | null)[]): LoadScale | null {
  const [first, ...others] = scales.filter((scale) => scale !== null);
  if (first === undefined) return null;
  const alike = others.every(
    ({ full, limited, cautionPart }) =>
      full === first.full && limited === first.limited && cautionPart === first.cautionPart,
  );
  const limited = [first, ...others].every((scale) => scale.limited);
  return alike ? first : { ...first, full: null, limited, cautionPart: null };
}
