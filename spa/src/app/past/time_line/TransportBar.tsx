import './transport.css';
import { type ReactNode, useId } from 'react';
import { type PastControls, type Playhead, SPEEDS, type Speed } from '../../../past/past_types.ts';
import { Sign } from '../../robot/Chip.tsx';
import { Icon, IconButton, PastIcon } from '../../shell/icons.tsx';
import { type KeyAction, withKey } from '../../shell/page_keys.ts';
import { useStore } from '../../state/hooks.ts';
import { more } from '../../text/language.ts';
import { useMomentsText, usePastText } from '../../text/late.ts';
import { hundredthsWords, spanWords } from '../../words/moment.ts';
import { ALL, chooseOn, chosenOn, pressLoop, scalesOf, stepScale } from './line.ts';
import { speedWords, whenWords } from './spoken.ts';
import './past.css';

/** One frame: a triangle that points the way, and a bar. */
const FrameBackIcon = () => (
  <Icon>
    <path d="M17 6.5v11L8.2 12zM5.6 6.5v11" />
  </Icon>
);

const FrameOnIcon = () => (
  <Icon>
    <path d="M7 6.5v11l8.8-5.5zM18.4 6.5v11" />
  </Icon>
);

const OCTAGON = 'l3.2-3.2h4.6l3.2 3.2v4.6l-3.2 3.2h-4.6l-3.2-3.2z';

/** A fault's octagon, and the way to it. */
const PreviousFaultIcon = () => (
  <Icon>
    <path d={`M10.5 9.7${OCTAGON}M6.5 7.5L2.5 12l4 4.5`} />
  </Icon>
);

const NextFaultIcon = () => (
  <Icon>
    <path d={`M2.5 9.7${OCTAGON}M17.5 7.5l4 4.5-4 4.5`} />
  </Icon>
);

const LoopIcon = () => (
  <Icon>
    <path d="M4.5 11.5V10A3.5 3.5 0 0 1 8 6.5h11M16 3.5l3 3-3 3M19.5 12.5V14a3.5 3.5 0 0 1-3.5 3.5H5M8 20.5l-3-3 3-3" />
  </Icon>
);

/** An arrow into a tray. */
const SaveIcon = () => (
  <Icon>
    <path d="M12 4v11M8 11.2l4 4 4-4M4.5 15.5V18A1.5 1.5 0 0 0 6 19.5h12a1.5 1.5 0 0 0 1.5-1.5v-2.5" />
  </Icon>
);

/** The row over the track while the past is shown: navigation, the moment itself, playback controls and scale. If space is short,
 *  some are hidden. */
export function TransportBar({
  controls,
  playhead,
  nowMs,
  hasFaults,
  onSave,
  children,
}: {
  controls: PastControls;
  playhead: Playhead;
  /** The moment of now. */
  nowMs: number;
  hasFaults: boolean;
  /** null: nothing can be saved here. */
  onSave: (() => void) | null;
  /** At the end of the row. */
  children: ReactNode;
}) {
  const text = usePastText();
  return (
    <div className="transport" data-testid="transport">
      <div className="transport-part">
        <Press
          name={text.previousFault}
          action="faultBack"
          press={() => controls.visitFault(-1)}
          disabled={!hasFaults}
        >
          <PreviousFaultIcon />
        </Press>
        <Press
          name={text.tenBack}
          action="tenBack"
          press={() => controls.skip(-10_000)}
          className="icon-button transport-ten"
        >
          −10
        </Press>
        <Press name={text.frameBack} action="frameBack" press={() => controls.step(-1)}>
          <FrameBackIcon />
        </Press>
        <Press name={text.frameOn} action="frameOn" press={() => controls.step(1)}>
          <FrameOnIcon />
        </Press>
        <Press
          name={text.tenOn}
          action="tenOn"
          press={() => controls.skip(10_000)}
          className="icon-button transport-ten"
        >
          +10
        </Press>
        <Press
          name={text.nextFault}
          action="faultOn"
          press={() => controls.visitFault(1)}
          disabled={!hasFaults}
        >
          <NextFaultIcon />
        </Press>
      </div>
      <button
        type="button"
        className="transport-moment"
        title={withKey(text.jump, 'jump')}
        aria-haspopup="dialog"
        onClick={() => chooseOn(controls, { isJumpOpen: true })}
      >
        {playhead.recorded === null ? <PastIcon /> : <Sign word="RECORDED" />}
        <span data-testid="moment">{preciseWords(playhead, nowMs)}</span>
        {playhead.note === 'loading' && <span className="transport-loading">{more().pastLoading}</span>}
      </button>
      <div className="transport-part">
        <Speeds speed={playhead.speed} onSpeed={(speed) => controls.setSpeed(speed)} />
        <LoopButton controls={controls} playhead={playhead} />
        {onSave !== null && (
          <IconButton
            label={text.save}
            title={withKey(text.save, 'save')}
            data-testid="save-button"
            onClick={onSave}
          >
            <SaveIcon />
          </IconButton>
        )}
        {children}
      </div>
    </div>
  );
}

/** The moment and how long ago it was; when paused, with hundredths of a second, so that frames can be told apart. */
export function preciseWords(playhead: Playhead, nowMs: number): string {
  const { momentMs, playing } = playhead;
  const words = whenWords(playhead, momentMs, nowMs);
  if (playing) return words;
  return words.replace(' · ', `${hundredthsWords(momentMs)} · `);
}

function Press({
  name,
  action,
  press,
  children,
  ...rest
}: {
  name: string;
  /** What its key does. */
  action: KeyAction;
  press: () => void;
  disabled?: boolean;
  className?: string;
  children: ReactNode;
}) {
  return (
    <IconButton label={name} title={withKey(name, action)} onClick={press} {...rest}>
      {children}
    </IconButton>
  );
}

/** All speeds side by side; if space is short, a list that opens. */
function Speeds({ speed, onSpeed }: { speed: Speed; onSpeed: (speed: Speed) => void }) {
  const text = usePastText();
  const name = useId();
  return (
    <>
      <fieldset className="segments transport-speeds">
        <legend className="unseen">{text.speed}</legend>
        {SPEEDS.map((each) => (
          <label key={each}>
            <input type="radio" name={name} checked={each === speed} onChange={() => onSpeed(each)} />
            <span>{speedWords(each)}</span>
          </label>
        ))}
      </fieldset>
      <select
        className="transport-speed"
        aria-label={text.speed}
        title={text.speed}
        value={speed}
        onChange={(event) => onSpeed(Number(event.currentTarget.value) as Speed)}
      >
        {SPEEDS.map((each) => (
          <option key={each} value={each}>
            {speedWords(each)}
          </option>
        ))}
      </select>
    </>
  );
}

function LoopButton({ controls, playhead }: { controls: PastControls; playhead: Playhead }) {
  const text = usePastText();
  const { loopStartMs: startMs } = useStore(chosenOn(controls));
  const state = playhead.loop !== null ? 'on' : startMs !== null ? 'started' : 'off';
  const name = { off: text.loopFrom, started: text.loopTo, on: text.loopOff }[state];
  return (
    <IconButton
      className="icon-button transport-loop"
      label={name}
      title={withKey(name, 'loop')}
      data-state={state}
      data-testid="loop-button"
      onClick={() => pressLoop(controls)}
    >
      <LoopIcon />
    </IconButton>
  );
}

/** The choice of the time span of the line. With two options both are shown, or only the current one if space is short; with
 *  more, they are in a list between two buttons. */
export function ScaleChoice({
  controls,
  scale,
  windowMs,
}: {
  controls: PastControls;
  /** The scale that is shown. */
  scale: number;
  /** The length of the available past. */
  windowMs: number;
}) {
  const scales = scalesOf(windowMs);
  const words = (ms: number) => spanWords(ms === ALL ? windowMs : ms);
  if (scales.length === 2) return <TwoScales {...{ controls, scale, scales, words }} />;
  return <Scales {...{ controls, scale, scales, words }} />;
}

interface Given {
  readonly controls: PastControls;
  readonly scale: number;
  readonly scales: readonly number[];
  readonly words: (scale: number) => string;
}

function TwoScales({ controls, scale, scales, words }: Given) {
  const text = usePastText();
  const other = scales.find((each) => each !== scale) ?? ALL;
  const name = text.showLast(words(other));
  return (
    <button
      type="button"
      className="segments range"
      aria-label={name}
      title={name}
      data-testid="range"
      onClick={() => chooseOn(controls, { scaleMs: other })}
    >
      {scales.map((each) => (
        <span key={each} data-on={each === scale}>
          {words(each)}
        </span>
      ))}
    </button>
  );
}

function Scales({ controls, scale, scales, words }: Given) {
  const text = useMomentsText();
  const step = (by: 1 | -1, name: string, sign: string) => (
    <button
      type="button"
      className="icon-button scale-step"
      aria-label={name}
      title={name}
      disabled={scale === (by < 0 ? scales[0] : scales.at(-1))}
      onClick={() => stepScale(controls, by)}
    >
      {sign}
    </button>
  );
  return (
    <fieldset className="scale">
      <legend className="unseen">{text.scale}</legend>
      {step(1, text.scaleMore, '−')}
      <select
        className="transport-speed scale-list"
        aria-label={text.scale}
        title={text.scale}
        value={scale}
        data-testid="scale"
        onChange={(event) => chooseOn(controls, { scaleMs: Number(event.currentTarget.value) })}
      >
        {scales.map((each) => (
          <option key={each} value={each}>
            {words(each)}
          </option>
        ))}
      </select>
      {step(-1, text.scaleLess, '+')}
    </fieldset>
  );
}
