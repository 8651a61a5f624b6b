import { useEffect, useRef, useState } from 'react';
import type { LocalRobot } from '../drop/local_robot.ts';
import type { RobotScene } from '../scene/index.ts';
import { displayOf, formatNumber } from '../twin/format.ts';
import { showScene } from './handle.ts';
import { BackIcon } from './icons.tsx';
import { closeLocal } from './local.ts';
import { useSettings } from './settings.ts';
import { useTheme } from './theme.ts';

/** A robot that somebody dropped on the page: its body, a slider for each joint, and what is wrong with it. */
export function LocalPage({ robot }: { robot: LocalRobot }) {
  const host = useRef<HTMLDivElement>(null);
  const { scene, note } = useLocalScene(host, robot);
  useEffect(() => {
    document.title = `${robot.name} · Posecast`;
  }, [robot]);
  return (
    <div className="robot-page" data-testid="local-page">
      <header className="top">
        <button type="button" className="icon-button" onClick={closeLocal} aria-label="Close this robot">
          <BackIcon />
        </button>
        <h1 className="robot-name">{robot.name}</h1>
        <span className="quiet">only in this browser</span>
      </header>
      <main className="split local">
        <div className="split-body">
          <section className="stage" aria-label="Body">
            <div className="canvas" ref={host} data-testid="scene" data-shown="true" />
            {note !== null && (
              <div className="stage-middle">
                <p className="stage-say">{note}</p>
              </div>
            )}
          </section>
        </div>
        <aside className="split-panel local-panel" aria-label="Joints">
          <Findings robot={robot} />
          <Sliders robot={robot} scene={scene} />
        </aside>
      </main>
    </div>
  );
}

function useLocalScene(host: React.RefObject<HTMLDivElement | null>, robot: LocalRobot) {
  const theme = useTheme();
  const themeNow = useRef(theme);
  themeNow.current = theme;
  const [scene, setScene] = useState<RobotScene | null>(null);
  const [note, setNote] = useState<string | null>(null);
  useEffect(() => {
    let left = false;
    let made: RobotScene | null = null;
    setNote(null);
    import('../scene/index.ts')
      .then(async ({ RobotScene: Scene }) => {
        if (left || host.current === null) return;
        made = new Scene(host.current, { theme: themeNow.current });
        showScene(made);
        setScene(made);
        made.setPose({ joints: new Map(), base: null }, true);
        const report = await made.loadLocal(robot.manifest, robot);
        if (!left && report.error !== undefined) setNote(`The body can't be shown: ${report.error}`);
      })
      .catch((error: unknown) => {
        if (!left) setNote(error instanceof Error ? error.message : String(error));
      });
    return () => {
      left = true;
      showScene(null);
      setScene(null);
      made?.dispose();
    };
  }, [host, robot]);
  useEffect(() => scene?.setTheme(theme), [scene, theme]);
  return { scene, note };
}

/** What is wrong with it, worst first. */
function Findings({ robot }: { robot: LocalRobot }) {
  const { diagnoses } = robot;
  if (diagnoses.length === 0)
    return <p className="quiet local-well">Nothing wrong was found in this URDF.</p>;
  return (
    <details className="local-findings" open data-testid="findings">
      <summary>
        {diagnoses.length} {diagnoses.length === 1 ? 'finding' : 'findings'}
      </summary>
      <ul>
        {diagnoses.map(({ severity, text }) => (
          <li key={text} data-severity={severity}>
            <b>{severity}</b> {text}
          </li>
        ))}
      </ul>
    </details>
  );
}

function Sliders({ robot, scene }: { robot: LocalRobot; scene: RobotScene | null }) {
  const { angle } = useSettings();
  const [values, setValues] = useState<ReadonlyMap<string, number>>(new Map());
  useEffect(() => {
    // Every joint every time: one that nobody has touched stands at 0.
    const joints = new Map(robot.joints.map(({ name }) => [name, values.get(name) ?? 0]));
    scene?.setPose({ joints, base: null }, true);
  }, [scene, robot, values]);
  const words = (value: number, unit: string) => {
    const display = displayOf(unit, angle);
    return `${formatNumber(value, display)} ${display.unit}`;
  };
  return (
    <div className="local-sliders">
      <button type="button" className="text-button" onClick={() => setValues(new Map())}>
        All to zero
      </button>
      {robot.joints.map(({ name, unit, lower, upper }) => (
        <label key={name} className="local-slider">
          <span>{name}</span>
          <output>{words(values.get(name) ?? 0, unit)}</output>
          <input
            type="range"
            min={lower}
            max={upper}
            step={(upper - lower) / 500}
            value={values.get(name) ?? 0}
            onChange={({ target }) => setValues(new Map(values).set(name, Number(target.value)))}
          />
        </label>
      ))}
    </div>
  );
}
