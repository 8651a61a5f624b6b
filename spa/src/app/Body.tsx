import { type ReactNode, useEffect, useRef, useState } from 'react';
import type { ModelReport, RobotScene } from '../scene/index.ts';
import { bodyFollows } from './body_link.ts';
import { showScene } from './handle.ts';
import { apiUrl, type RobotLink, useConnection, useVersion, useWord } from './robot_link.ts';
import { changeSettings, useSettings } from './settings.ts';
import { useTheme } from './theme.ts';
import { useNow } from './tick.ts';
import { bareWords, bytesWords, missingWords, stageWords, waitingWords } from './words.ts';

const SAY_WHY_AFTER_MS = 3000;

type Model =
  | { phase: 'none' }
  | { phase: 'loading'; received: number; total: number }
  | { phase: 'shown'; note: string | null }
  | { phase: 'failed'; why: string };

/** The robot as a body. The drawing itself is a chunk of its own that this component asks for; without it, or without
 *  WebGL, the page says so in one line and the numbers stand. */
export function Body({ link }: { link: RobotLink }) {
  const host = useRef<HTMLDivElement>(null);
  const { scene, why } = useScene(host, link);
  const model = useModel(scene, link);
  const { shown } = useSettings();
  useVersion(link);
  const hasRef = link.twin.schema?.field('ref') != null;

  return (
    <section className="stage" aria-label="Body">
      <div className="canvas" ref={host} data-testid="scene" data-shown={model.phase !== 'none'} />
      {model.phase === 'loading' && <Progress received={model.received} total={model.total} />}
      <StageNote link={link} />
      <div className="stage-middle">
        {why !== null ? (
          <p className="stage-say" data-testid="no-scene">
            {why}
          </p>
        ) : (
          model.phase === 'failed' && (
            <p className="stage-say" data-testid="no-model">
              {model.why}
            </p>
          )
        )}
        {why === null && model.phase === 'none' && <Waiting link={link} />}
      </div>
      {model.phase === 'loading' && model.total > 0 && (
        <p className="stage-foot">Loading the body: {bytesWords(model.received, model.total)}</p>
      )}
      {model.phase === 'shown' && model.note !== null && (
        <p className="stage-foot" data-testid="model-note">
          {model.note}
        </p>
      )}
      {scene !== null && model.phase !== 'none' && (
        <div className="stage-tools">
          {hasRef && (
            <fieldset className="segments">
              <legend className="unseen">What the body shows</legend>
              {(['pos', 'ref'] as const).map((choice) => (
                <label key={choice}>
                  <input
                    type="radio"
                    name="shown"
                    checked={shown === choice}
                    onChange={() => changeSettings({ shown: choice })}
                  />
                  <span title={choice === 'pos' ? 'Where the robot is' : 'Where it was told to be'}>
                    {choice}
                  </span>
                </label>
              ))}
            </fieldset>
          )}
          <fieldset className="segments">
            <legend className="unseen">Camera</legend>
            <Tool onClick={() => scene.look('home')} title="Back to the first view">
              ↺
            </Tool>
            <Tool onClick={() => scene.look('front')}>front</Tool>
            <Tool onClick={() => scene.look('side')}>side</Tool>
          </fieldset>
          {model.phase === 'shown' && <Finer scene={scene} />}
        </div>
      )}
    </section>
  );
}

function Tool({ onClick, title, children }: { onClick: () => void; title?: string; children: ReactNode }) {
  return (
    <button type="button" onClick={onClick} title={title} aria-label={title}>
      {children}
    </button>
  );
}

/** Asks for the finest shells, where there are finer ones than a page fetches by itself. */
function Finer({ scene }: { scene: RobotScene }) {
  const [state, setState] = useState<'offered' | 'coming' | 'done' | 'failed'>('offered');
  const [received, setReceived] = useState(0);
  const bytes = useRef(scene.finerBytes);
  if (bytes.current === null || state === 'done') return null;
  const size = bytes.current;
  const ask = () => {
    setState('coming');
    scene
      .refine((now) => setReceived(now))
      .then(
        () => setState('done'),
        () => setState('failed'),
      );
  };
  const words = {
    offered: `finer · ${bytesWords(size, 0)}`,
    coming: bytesWords(received, size),
    failed: 'did not come · again',
  }[state];
  return (
    <fieldset className="segments" disabled={state === 'coming'} data-testid="finer">
      <legend className="unseen">Detail</legend>
      <Tool onClick={ask} title="Show the body in full detail">
        {words}
      </Tool>
    </fieldset>
  );
}

function useScene(host: React.RefObject<HTMLDivElement | null>, link: RobotLink) {
  const theme = useTheme();
  const [scene, setScene] = useState<RobotScene | null>(null);
  const [why, setWhy] = useState<string | null>(null);
  const themeNow = useRef(theme);
  themeNow.current = theme;

  useEffect(() => {
    let left = false;
    let made: RobotScene | null = null;
    let stop: (() => void) | null = null;
    if (!hasWebGl()) {
      setWhy('This browser has no 3D. The numbers show everything the robot says.');
      return;
    }
    import('../scene/index.ts')
      .then(({ RobotScene: Scene }) => {
        if (left || host.current === null) return;
        made = new Scene(host.current, { theme: themeNow.current });
        stop = bodyFollows(made, link);
        showScene(made);
        setScene(made);
      })
      .catch((error: unknown) => {
        const what = error instanceof Error ? error.message : String(error);
        if (!left) setWhy(`The 3D view did not load (${what}). The numbers show everything the robot says.`);
      });
    return () => {
      left = true;
      stop?.();
      showScene(null);
      setScene(null);
      made?.dispose();
    };
  }, [host, link]);

  useEffect(() => scene?.setTheme(theme), [scene, theme]);
  return { scene, why };
}

function useModel(scene: RobotScene | null, link: RobotLink): Model {
  useVersion(link);
  const { robot, modelHash } = link.twin;
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
    scene.load(apiUrl(`robots/${robot}/model/${modelHash}/manifest.json`), progress).then((report) => {
      if (left) return;
      if (report.error !== undefined) {
        setModel({ phase: 'failed', why: `The body can't be shown: ${report.error}` });
        return;
      }
      setModel({
        phase: 'shown',
        note: noteOf(report),
      });
    });
    return () => {
      left = true;
    };
  }, [scene, robot, modelHash]);
  return model;
}

function noteOf({ bare, missing }: ModelReport): string | null {
  if (bare !== undefined) return bareWords(bare);
  return missing.length > 0 ? missingWords(missing, null) : null;
}

function hasWebGl(): boolean {
  try {
    const context = document.createElement('canvas').getContext('webgl2');
    context?.getExtension('WEBGL_lose_context')?.loseContext(); // a page may hold few contexts
    return context !== null;
  } catch {
    return false;
  }
}

/** A thin bar at the top edge that counts real bytes. */
function Progress({ received, total }: { received: number; total: number }) {
  const part = total > 0 ? Math.min(1, received / total) : 0;
  return (
    <div
      className="progress"
      role="progressbar"
      aria-label="Loading the body"
      aria-valuenow={Math.round(part * 100)}
      data-testid="progress"
    >
      <i style={{ transform: `scaleX(${part})` }} />
    </div>
  );
}

/** Stamped over a picture that is not the present. */
function StageNote({ link }: { link: RobotLink }) {
  const now = useNow(250);
  const connection = useConnection(link);
  const verdict = link.watch.verdict();
  const words = stageWords(verdict, connection, now);
  if (words === null && connection.problem === null) return null;
  const canTry = verdict.cause === 'no connection' && connection.phase !== 'connecting';
  return (
    <div className="stage-note" data-word={verdict.word ?? ''} data-testid="stage-note">
      <span>{connection.problem ?? words}</span>
      {canTry && (
        <button type="button" className="text-button" onClick={() => link.client.wake()}>
          Try now
        </button>
      )}
    </div>
  );
}

/** Nothing at first; after three seconds, what is being waited for. */
function Waiting({ link }: { link: RobotLink }) {
  const now = useNow(500);
  const { phase } = useConnection(link);
  const word = useWord(link);
  useVersion(link);
  const { twin } = link;
  // A line over the body that says so already is enough.
  if (now - twin.evidence.openedMs < SAY_WHY_AFTER_MS || word === 'STALE' || word === 'OFFLINE') return null;
  const words = waitingWords({ phase, schema: twin.schema !== null, pose: twin.state !== null });
  return (
    <p className="stage-say" data-testid="waiting">
      {words}
    </p>
  );
}
