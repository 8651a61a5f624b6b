import { useCallback, useEffect, useRef, useState } from 'react';
import { LatePart } from '../../browser/late_part.ts';
import { retryNow } from '../../browser/retry.ts';
import type { Emitter } from '../../kit.ts';
import { builtModelAt } from '../../model/files.ts';
import type { ModelReport } from '../../model/report.ts';
import { accounts } from '../../relay/relay.ts';
import type { BodyView, RowView } from '../../scene/figure/body_view.ts';
import { StickFigure } from '../../scene/figure/stick_figure.ts';
import type { RobotSigns } from '../../scene/signs/signs.ts';
import { isAbsent } from '../../stream/client.ts';
import { nowMs } from '../../stream/clock.ts';
import { isThen } from '../../twin/liveness.ts';
import { isolated } from '../../twin/names.ts';
import { Poser } from '../../twin/playback/pose.ts';
import { late, startWhenLoaded } from '../shell/late.tsx';
import { useTheme } from '../shell/theme.ts';
import { useTicked } from '../state/hooks.ts';
import { type RobotLink, useConnection, useVersion, useWord } from '../state/robot_link.ts';
import { settings } from '../state/settings.ts';
import { useShownSecond } from '../state/viewing.ts';
import { say, useText } from '../text/language.ts';
import { saysMore } from '../words/moment.ts';
import { bytesWords, problemWords, stageWords, waitingWords } from '../words/status.ts';
import { keepLoading, useBodyView, useCameraControls } from './use_body_view.ts';

// Loaded with the body, so that the page starts without waiting for them.
const BodyNotes = late(async () => (await import('./BodyNotes.tsx')).BodyNotes);
const BodyTools = late(async () => (await import('./BodyTools.tsx')).BodyTools);
const SignIn = late(
  async () => (await import('../settings/SignIn.tsx')).SignIn,
  () => accounts !== null,
);
const SelfPlots = late(async () => (await import('./SelfPlots.tsx')).SelfPlots);
const LoadLegend = late(async () => (await import('./LoadLegend.tsx')).LoadLegend);

const BODY_LINK = new LatePart(() => import('./body_link.ts'));
const VIEW_ADDRESS = new LatePart(() => import('../share/view_address.ts'));
const SIGN_LINK = new LatePart(() => import('./sign_link.ts'));

/** The page waits this long before it says what it is waiting for. */
const SAY_WHY_AFTER_MS = 3000;
/** A robot with a model announces it within this time after the page opens. */
const NO_MODEL_AFTER_MS = 1000;
type Model =
  | { phase: 'none' }
  | { phase: 'loading'; received: number; total: number }
  | { phase: 'shown'; report: ModelReport }
  | { phase: 'failed'; why: string; coming: boolean };

/** The robot's body with its notes and tools, in the present or past state that `link` gives. The page's address follows `live`
 *  unless that is null. The renderer is a separate chunk that this component loads; if that fails, one line says so and the
 *  numbers still work. */
export function Body({ link, live = link }: { link: RobotLink; live?: RobotLink | null }) {
  const host = useRef<HTMLDivElement>(null);
  const { view, drawn, trouble, why, coming, choose } = useBodyView(host, usePlayed(link));
  useCameraControls(host, view, link.twin);
  useViewAddress(view, drawn, live);
  const signs = useSigns(view, link);
  const model = useModel(view, link);
  const text = useText();

  return (
    <section className="stage" aria-label={text.body}>
      {why === null && (model.phase === 'none' || model.phase === 'loading') && (
        <FirstStickFigure link={link} />
      )}
      <div className="canvas" ref={host} data-testid="scene" data-shown={model.phase !== 'none'} />
      {model.phase === 'loading' && <Progress received={model.received} total={model.total} />}
      <StageNote link={link} />
      <div className="stage-middle">
        {why !== null ? (
          <p className="stage-say" data-testid="no-scene">
            {why} {coming && <TryNow />}
          </p>
        ) : (
          model.phase === 'failed' && (
            <p className="stage-say" data-testid="no-model">
              {model.why} {model.coming && <TryNow />}
            </p>
          )
        )}
      </div>
      {why === null && model.phase === 'none' && <Waiting link={link} />}
      {model.phase === 'loading' && model.total > 0 && (
        <p className="stage-foot">{text.loadingBody(bytesWords(model.received, model.total))}</p>
      )}
      {(trouble !== null || model.phase !== 'none') && (
        <BodyNotes
          link={link}
          trouble={trouble}
          report={model.phase === 'shown' ? model.report : null}
          choose={choose}
        />
      )}
      {signs !== null && model.phase !== 'none' && <LoadLegend signs={[signs]} />}
      {view !== null && model.phase !== 'none' && (
        <BodyTools link={link} view={view} shown={model.phase === 'shown'} />
      )}
    </section>
  );
}

function TryNow() {
  return (
    <button type="button" className="text-button" data-testid="try-now" onClick={retryNow}>
      {say().tryNow}
    </button>
  );
}

/** Prepares a new view: the robot's motion is played in it. If the link changes, the same view plays the new link. */
function usePlayed(link: RobotLink) {
  const now = useRef(link);
  const play = useRef<(() => void) | null>(null);
  useEffect(() => {
    if (now.current === link) return;
    now.current = link;
    play.current?.();
  }, [link]);
  return useCallback(async () => {
    const { bindBody } = await BODY_LINK.load(); // the code of the view loads at the same time
    return (view: RowView) => {
      let stop = bindBody(view, now.current);
      play.current = () => {
        stop();
        stop = bindBody(view, now.current);
      };
      return () => {
        play.current = null;
        stop();
      };
    };
  }, []);
}

/** Keeps the page's address in step with the view; the code for it is loaded with the body. */
function useViewAddress(view: BodyView | null, drawn: Emitter, link: RobotLink | null): void {
  useEffect(() => {
    if (view === null || link === null) return;
    return startWhenLoaded(
      VIEW_ADDRESS.load().then(
        ({ bindAddress }) =>
          () =>
            bindAddress(view, link, drawn),
      ),
    );
  }, [view, drawn, link]);
}

/** Connects the signs to the robot's readings. */
function useSigns(scene: BodyView | null, link: RobotLink): RobotSigns | null {
  const [signs, setSigns] = useState<RobotSigns | null>(null);
  useEffect(() => {
    if (scene === null) return;
    // Until this chunk is here, the body is shown without signs.
    const end = startWhenLoaded(
      SIGN_LINK.load().then(({ bindSigns }) => () => {
        const { signs: bound, stop } = bindSigns((read) => scene.showSigns(read), link);
        setSigns(bound);
        return stop;
      }),
    );
    return () => {
      end();
      setSigns(null);
    };
  }, [scene, link]);
  return signs;
}

function useModel(scene: BodyView | null, link: RobotLink): Model {
  useVersion(link);
  const { manifestUrl } = link;
  const { modelHash } = link.twin;
  const [model, setModel] = useState<Model>({ phase: 'none' });
  useEffect(() => {
    if (scene === null || modelHash === null) {
      setModel({ phase: 'none' });
      return;
    }
    let left = false;
    setModel({ phase: 'loading', received: 0, total: 0 });
    const progress = (received: number, total: number) => {
      if (!left) setModel({ phase: 'loading', received, total });
    };
    const url = manifestUrl(modelHash);
    const stop = keepLoading(
      url,
      () => scene.load(url, progress),
      (report) => {
        if (report.error !== undefined) {
          const why = say().bodyFailed(isolated(report.error));
          setModel({ phase: 'failed', why, coming: report.passing === true });
          return;
        }
        setModel({ phase: 'shown', report });
      },
    );
    return () => {
      left = true;
      stop();
    };
  }, [scene, manifestUrl, modelHash]);
  useEffect(() => {
    link.twin.acceptTree(model.phase === 'shown' ? (scene?.tree() ?? null) : null);
  }, [scene, model, link]);
  return model;
}

/** A thin progress bar at the top edge, in bytes received. */
function Progress({ received, total }: { received: number; total: number }) {
  const part = total > 0 ? Math.min(1, received / total) : 0;
  return (
    <div
      className="progress"
      role="progressbar"
      aria-label={say().loadingBody('')}
      aria-valuenow={Math.round(part * 100)}
      data-testid="progress"
    >
      <i style={{ transform: `scaleX(${part})` }} />
    </div>
  );
}

/** A note over the picture when it does not show the present pose. */
function StageNote({ link }: { link: RobotLink }) {
  const connection = useConnection(link);
  useWord(link); // shows a new state word at once
  useShownSecond(); // redraws as the time line moves
  const verdict = link.watch.verdict();
  const words = useTicked(250, () => stageWords(link.watch.verdict(), connection, nowMs()));
  const { problem } = connection;
  if (words === null && problem === null) return null;
  // a hidden robot looks absent, and may be shown to who signs in
  const isRefused = connection.phase === 'ended' || isAbsent(connection);
  const canTry = verdict.cause === 'no connection' && connection.phase !== 'connecting';
  return (
    <div
      className="stage-note"
      data-word={verdict.word ?? ''}
      data-more={saysMore(verdict)}
      data-testid="stage-note"
    >
      <span>
        {problem === null || (words !== null && problem.what === 'newer') ? words : problemWords(problem)}
      </span>
      {canTry && (
        <button type="button" className="text-button" onClick={() => link.client.wake(true)}>
          {say().tryNow}
        </button>
      )}
      {accounts !== null && isRefused && <SignIn refused />}
    </div>
  );
}

/** Shows nothing at first, and after three seconds what the page is waiting for. */
function Waiting({ link }: { link: RobotLink }) {
  const { phase } = useConnection(link);
  const word = useWord(link);
  useVersion(link);
  const { twin } = link;
  // In these states, a line over the body already says so.
  const isSaid = word === 'STALE' || word === 'OFFLINE' || isThen(word);
  const { hasNoModel, words } = useTicked(500, () => {
    const { schema, state, modelHash, evidence } = twin;
    const openMs = nowMs() - evidence.openedMs;
    return {
      hasNoModel: state !== null && modelHash === null && openMs > NO_MODEL_AFTER_MS,
      words:
        openMs < SAY_WHY_AFTER_MS || isSaid
          ? ''
          : waitingWords({ phase, schema: schema !== null, pose: state !== null }),
    };
  });
  if (hasNoModel) return <SelfPlots link={link} />;
  return (
    words !== '' && (
      <div className="stage-middle">
        <p className="stage-say" data-testid="waiting">
          {words}
        </p>
      </div>
    )
  );
}

/** Draws the robot as a stick figure as soon as its model's manifest is loaded, usually before the renderer and the meshes. Draws
 *  nothing for raw bundles, which list no joints. */
function FirstStickFigure({ link }: { link: RobotLink }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const theme = useTheme();
  useVersion(link);
  const { modelHash } = link.twin;
  // biome-ignore lint/correctness/useExhaustiveDependencies: the line colour depends on the theme
  useEffect(() => {
    const { current } = canvas;
    if (current === null || modelHash === null) return;
    let leave: (() => void) | null = null;
    let left = false;
    builtModelAt(link.manifestUrl(modelHash))
      .then((manifest) => {
        if (left || manifest === null) return; // the joints of a raw bundle are unknown until its URDF is read
        const figure = new StickFigure(current, manifest);
        figure.setColor(getComputedStyle(current).color);
        leave = follow(figure, link);
      })
      .catch(() => {}); // the scene loads the same file and reports errors
    return () => {
      left = true;
      leave?.();
    };
  }, [link, modelHash, theme]);
  return <canvas ref={canvas} className="first-sketch" data-testid="first-sketch" />;
}

function follow(figure: StickFigure, { twin }: RobotLink): () => void {
  let poser: Poser | null = null;
  let of: unknown = null;
  const pose = () => {
    const { schema, state } = twin;
    if (schema === null || state === null) return;
    if (poser === null || of !== schema) {
      const told = settings().shown === 'ref' && schema.field('ref') !== null;
      poser = new Poser(schema, told ? 'ref' : 'pos');
      of = schema;
    }
    figure.setPose(poser.pose(state.codes));
  };
  pose();
  return twin.onState(pose);
}
