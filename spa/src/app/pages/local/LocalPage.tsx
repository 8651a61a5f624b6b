import { useEffect, useEffectEvent, useMemo, useRef, useState } from 'react';
import type { ModelReport } from '../../../model/report.ts';
import { Balance, FILES } from '../../../scene/signs/balance.ts';
import { RobotSigns } from '../../../scene/signs/signs.ts';
import type { RobotScene } from '../../../scene/three/index.ts';
import { displayOf, formatNumber } from '../../../twin/format.ts';
import { ValueLimits } from '../../../twin/limits.ts';
import { isolated } from '../../../twin/names.ts';
import { NO_JOINTS } from '../../../twin/playback/pose.ts';
import { distrustsMasses, type Finding } from '../../../urdf/finding.ts';
import type { LocalRobot } from '../../../urdf/local_robot.ts';
import { loadThree, useCameraControls } from '../../robot/use_body_view.ts';
import { shownScene } from '../../shell/debug_api.ts';

import { BackIcon, IconButton } from '../../shell/icons.tsx';
import { useTheme } from '../../shell/theme.ts';
import { changeSettings, settings, useSettings } from '../../state/settings.ts';
import { languageTag, say, useMore, useText } from '../../text/language.ts';
import { useBalanceText } from '../../text/late.ts';
import { chooseUrdf, closeLocal } from './local.ts';
import './local.css';

/** The page of a robot from files on this computer: its body, a slider for each joint, and the problems in its files. `urdfs`:
 *  the paths of all URDFs among the files, for choosing another. */
export function LocalPage({ robot, urdfs }: { robot: LocalRobot; urdfs: readonly string[] }) {
  const host = useRef<HTMLDivElement>(null);
  const { scene, report } = useLocalScene(host, robot);
  const findings = useMemo(() => robot.findings(report?.meshes ?? null), [robot, report]);
  const text = useText();
  const rest = useMore();
  useCameraControls(host, scene);
  useEffect(() => {
    document.title = `${isolated(robot.name)} · Posecast`;
  }, [robot]);
  return (
    <div className="robot-page" data-testid="local-page">
      <header className="top">
        <IconButton onClick={closeLocal} label={rest.closeRobot}>
          <BackIcon />
        </IconButton>
        <h1 className="robot-name" title={isolated(robot.name)}>
          {isolated(robot.name)}
        </h1>
        <span className="quiet">{rest.onlyHere}</span>
      </header>
      <main className="split local">
        <div className="split-body">
          <section className="stage" aria-label={text.body}>
            <div className="canvas" ref={host} data-testid="scene" data-shown="true" />
            {report?.note != null && (
              <div className="stage-middle">
                <p className="stage-say">{report.note}</p>
              </div>
            )}
          </section>
        </div>
        <aside className="split-panel local-panel" aria-label={text.joints}>
          {urdfs.length > 1 && <Choice chosen={robot.path} urdfs={urdfs} />}
          <Findings findings={findings} whole={report !== null} />
          <LocalBalance robot={robot} scene={scene} findings={report === null ? null : findings} />
          <Sliders robot={robot} scene={scene} />
        </aside>
      </main>
    </div>
  );
}

/** The result of loading the body. */
interface LocalReport {
  /** Why there is no body; null if there is one. */
  readonly note: string | null;
  readonly meshes: ModelReport['meshes'];
}

function useLocalScene(host: React.RefObject<HTMLDivElement | null>, robot: LocalRobot) {
  const theme = useTheme();
  const themeNow = useEffectEvent(() => theme);
  const [scene, setScene] = useState<RobotScene | null>(null);
  const [loaded, setLoaded] = useState<{ robot: LocalRobot; report: LocalReport } | null>(null);
  useEffect(() => {
    let left = false;
    let made: RobotScene | null = null;
    loadThree()
      .then(async ({ RobotScene: Scene }) => {
        if (left || host.current === null) return;
        made = new Scene(host.current, { theme: themeNow() });
        shownScene.set(made);
        setScene(made);
        made.setPose({ joints: NO_JOINTS, base: null }, true);
        const report = await made.loadLocal(robot);
        const note = report.error === undefined ? null : say().bodyFailed(isolated(report.error));
        if (!left) setLoaded({ robot, report: { note, meshes: report.meshes } });
      })
      .catch((error: unknown) => {
        const note = isolated(error instanceof Error ? error.message : String(error));
        if (!left) setLoaded({ robot, report: { note, meshes: undefined } });
      });
    return () => {
      left = true;
      shownScene.set(null);
      setScene(null);
      made?.dispose();
    };
  }, [host, robot]);
  useEffect(() => scene?.setTheme(theme), [scene, theme]);
  return { scene, report: loaded?.robot === robot ? loaded.report : null };
}

/** The choice among several URDFs in the same files; the likeliest is shown first. */
function Choice({ chosen, urdfs }: { chosen: string; urdfs: readonly string[] }) {
  const text = useMore();
  return (
    <label className="local-choice">
      <span className="quiet">{text.robotsInFiles(urdfs.length)}</span>
      <select
        value={chosen}
        data-testid="choose-urdf"
        onChange={({ target }) => void chooseUrdf(target.value)}
      >
        {urdfs.map((path) => (
          <option key={path} value={path}>
            {isolated(path)}
          </option>
        ))}
      </select>
    </label>
  );
}

const SEVERITIES = { error: 'severityError', warning: 'severityWarning', hint: 'severityHint' } as const;

/** The problems in the files, worst first: findings in the URDF at once, those in meshes once they have been read. `whole`: the
 *  meshes have been read. */
function Findings({ findings, whole }: { findings: readonly Finding[]; whole: boolean }) {
  const text = useMore();
  if (findings.length === 0) return !whole ? null : <p className="quiet local-well">{text.nothingWrong}</p>;
  return (
    <details className="local-findings" open data-testid="findings">
      <summary>{text.findings(findings.length)}</summary>
      <ul>
        {findings.map(({ severity, code, text: said, line }) => (
          <li key={`${line} ${said}`} data-severity={severity} title={code}>
            <b>{text[SEVERITIES[severity]]}</b> {isolated(said)}
            {line !== null && <span className="quiet"> · {text.line(line)}</span>}
          </li>
        ))}
      </ul>
    </details>
  );
}

function Sliders({ robot, scene }: { robot: LocalRobot; scene: RobotScene | null }) {
  const text = useMore();
  const { angle } = useSettings();
  const [values, setValues] = useState<ReadonlyMap<string, number>>(new Map());
  useEffect(() => {
    // Always writes every joint; a joint whose slider has not moved is at 0.
    const names = robot.joints.map(({ name }) => name);
    const joints = { names, values: names.map((name) => values.get(name) ?? 0) };
    scene?.setPose({ joints, base: null }, true);
  }, [scene, robot, values]);
  const words = (value: number, unit: string) => {
    const display = displayOf(unit, angle);
    return `${formatNumber(value, display)} ${display.unit}`;
  };
  return (
    <div className="local-sliders">
      <button type="button" className="text-button" onClick={() => setValues(new Map())}>
        {text.allToZero}
      </button>
      {robot.joints.map(({ name, unit, lower, upper }) => (
        <label key={name} className="local-slider">
          <span title={isolated(name)}>{isolated(name)}</span>
          <output>{words(values.get(name) ?? 0, unit)}</output>
          <input
            type="range"
            min={lower}
            max={upper}
            step={(upper - lower) / 500}
            value={values.get(name) ?? 0}
            onChange={({ target }) => setValues(new Map(values).set(name, Number(target.value)))}
          />
          <small>{words(lower, unit)}</small>
          <small>{words(upper, unit)}</small>
        </label>
      ))}
    </div>
  );
}

/** Draws the centre of mass of a robot from local files, using the masses in its URDF, with a box to switch it off. Says in one
 *  line what is unknown. `findings`: about the files and their meshes; null before these are read. */
function LocalBalance(props: {
  robot: LocalRobot;
  scene: RobotScene | null;
  findings: readonly Finding[] | null;
}) {
  const { robot, scene, findings } = props;
  const { balance, palette, angle } = useSettings();
  const text = useBalanceText();
  const weighs = robot.urdf.links.some(({ inertial }) => inertial !== null && inertial.mass > 0);
  const believed = findings?.some(distrustsMasses) === false;
  const known = weighs && believed;
  const on = balance !== 'off';
  useEffect(() => {
    if (scene === null || !known || !on) return;
    const signs = new RobotSigns();
    const show = () => {
      signs.read({
        ...{ schema: FILES, codes: new Int32Array(FILES.size), limits: new ValueLimits(FILES.mapping) },
        ...{ tS: 0, lead: null, joint: null, live: true, language: languageTag(), nameOf: isolated },
        settings: { ...settings(), palette, angle, balance: 'on' },
      });
      scene.showSigns(signs);
    };
    show();
    const leave = Balance.part.subscribe(show); // draws once its code has loaded
    return () => {
      leave();
      signs.read(null);
      scene.showSigns(signs);
    };
  }, [scene, known, on, palette, angle]);
  if (findings === null) return null;
  const lack = known ? text.rawModel : believed ? text.noMasses : text.impossibleMasses;
  return (
    <div className="local-balance" data-testid="local-balance">
      {known ? (
        <label>
          <input
            type="checkbox"
            checked={on}
            onChange={({ target }) => changeSettings({ balance: target.checked ? 'auto' : 'off' })}
          />
          {text.balance}
        </label>
      ) : (
        text.balance
      )}
      <p className="quiet">{lack}</p>
    </div>
  );
}
