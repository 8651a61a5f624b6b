import { useEffect } from 'react';
import type { RobotScene } from '../../../scene/three/index.ts';
import { FILE_READINGS } from '../../../twin/overlay/file_readings.ts';
import { distrustsMasses, type Finding } from '../../../urdf/finding.ts';
import type { LocalRobot } from '../../../urdf/local_robot.ts';
import { BALANCE } from '../../balance/BalanceParts.tsx';
import { useLatePart } from '../../shell/late.tsx';
import { changeSettings, useSettings } from '../../state/settings.ts';
import { useBalanceText } from '../../text/balance.ts';
import { useMore } from '../../text/more.ts';

/** Draws the centre of mass of a robot from local files, using the masses in its URDF, with a box to switch it off. Says in one
 *  line what is unknown. `findings`: about the files and their meshes; null before these are read. */
export function LocalBalance(props: {
  robot: LocalRobot;
  scene: RobotScene | null;
  findings: readonly Finding[] | null;
}) {
  const { robot, scene, findings } = props;
  const { balance, palette, angle } = useSettings();
  const text = useBalanceText();
  const words = useMore();
  const part = useLatePart(BALANCE);
  const weighs = robot.urdf.links.some(({ inertial }) => inertial !== null && inertial.mass > 0);
  const believed = findings?.some(distrustsMasses) === false;
  const known = weighs && believed;
  const on = balance !== 'off';
  useEffect(() => {
    if (part === null || scene === null || !known || !on) return;
    scene.showSigns(FILE_READINGS, {
      ...{ live: true, from: 'pos', arrowScale: 1, palette, angle, words },
      balance: () => part.makeBalance(),
    });
    return () => scene.showSigns(null);
  }, [part, scene, known, on, palette, angle, words]);
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
