"""A MuJoCo simulation on a URL: python mujoco_arm.py [RELAY]    (pip install mujoco)

The same for a model of your own: MJCF as well as URDF. `qpos` has a free joint's quaternion as w, x, y, z;
`base=` wants x, y, z, w.
"""

import sys
import time
from pathlib import Path

import mujoco
import numpy as np
import posecast

URDF = Path(__file__).with_name("arm.urdf")


def main(relay: str = "tcp/127.0.0.1:7447") -> None:
    model = mujoco.MjModel.from_xml_path(str(URDF))
    data = mujoco.MjData(model)
    joints = [model.joint(i).name for i in range(model.njnt)]
    stiffness, target = np.array([40.0, 20.0]), np.zeros(2)

    with posecast.Robot("mujoco-arm", urdf=URDF, relay=relay, joints=joints) as robot:
        while True:
            target[:] = 0.5 * np.sin(data.time), 0.8 * np.sin(2 * data.time)
            data.qfrc_applied[:] = stiffness * (target - data.qpos) - 2.0 * data.qvel
            mujoco.mj_step(model, data)
            robot.publish(t=data.time, pos=data.qpos, ref=target, vel=data.qvel, effort=data.qfrc_applied)
            time.sleep(model.opt.timestep)


if __name__ == "__main__":
    main(*sys.argv[1:])
