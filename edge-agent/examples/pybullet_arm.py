"""A PyBullet simulation on a URL: python pybullet_arm.py [RELAY]    (pip install pybullet)"""

import math
import sys
import time
from pathlib import Path

import posecast
import pybullet as p

URDF = Path(__file__).with_name("arm.urdf")
STEP_S = 1 / 240


def main(relay: str = "tcp/127.0.0.1:7447") -> None:
    p.connect(p.DIRECT)
    p.setGravity(0, 0, -9.81)
    arm = p.loadURDF(str(URDF), useFixedBase=True)
    moving = [j for j in range(p.getNumJoints(arm)) if p.getJointInfo(arm, j)[2] != p.JOINT_FIXED]
    names = [p.getJointInfo(arm, j)[1].decode() for j in moving]

    with posecast.Robot("pybullet-arm", urdf=URDF, relay=relay, joints=names) as robot:
        step = 0
        while True:
            step += 1
            t = step * STEP_S
            target = [0.5 * math.sin(t), 0.8 * math.sin(2 * t)]
            p.setJointMotorControlArray(arm, moving, p.POSITION_CONTROL, target, forces=[20, 10])
            p.stepSimulation()
            states = p.getJointStates(arm, moving)
            xyz, quaternion = p.getBasePositionAndOrientation(arm)  # x, y, z, w, as base= has it
            robot.publish(
                t=t,
                pos=[state[0] for state in states],
                vel=[state[1] for state in states],
                effort=[state[3] for state in states],
                ref=target,
                base=(*xyz, *quaternion),
            )
            time.sleep(STEP_S)


if __name__ == "__main__":
    main(*sys.argv[1:])
