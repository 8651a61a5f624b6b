"""A Pinocchio model on a URL: python pinocchio_arm.py [RELAY]    (pip install pin)

A controller's plan as it is computed: here a path in joint space, its torques by inverse dynamics.
"""

import sys
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
import posecast

URDF = Path(__file__).with_name("arm.urdf")
AMPLITUDE, RATE = np.array([0.5, 0.8]), np.array([1.0, 2.0])


def main(relay: str = "tcp/127.0.0.1:7447") -> None:
    model = pin.buildModelFromUrdf(str(URDF))
    data = model.createData()
    # joint 0 is the universe; q has one number for each joint here (a continuous joint has two: cos and sin)
    joints = list(model.names)[1:]

    with posecast.Robot("pinocchio-arm", urdf=URDF, relay=relay, joints=joints) as robot:
        began_s = time.monotonic()
        while True:
            t = time.monotonic() - began_s
            q = AMPLITUDE * np.sin(RATE * t)
            v = AMPLITUDE * RATE * np.cos(RATE * t)
            a = -AMPLITUDE * RATE**2 * np.sin(RATE * t)
            tau = pin.rnea(model, data, q, v, a)
            robot.publish(t=t, pos=q, vel=v, effort=tau)
            time.sleep(0.002)


if __name__ == "__main__":
    main(*sys.argv[1:])
