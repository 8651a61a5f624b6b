"""What a call of `posecast.Robot.publish` costs the thread that makes it: 30 joints, `pos` and `ref`.

    python edge-agent/benches/publish.py [--windows 7]

The relay's part is played by a Zenoh router, so frames are made and sent meanwhile by the agent's threads.
Prints processor time of the caller's thread for each way of calling, the best and the median of the windows,
beside what an empty call costs on this machine now, and the longest calls by the wall clock at 1 kHz:
what the agent's threads and all else on the machine add to one in a hundred, one in a thousand.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import posecast

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests"))

from edge_stage import ROBOT, Router  # noqa: E402
from posecast_testing import until  # noqa: E402

JOINTS = [f"joint_{i}" for i in range(30)]
CALLS = 5_000  # of one window
MOST_US = 20.0
LOOP_S = 5.0


def time_us(call: Callable[[], None], calls: int) -> float:
    """Processor time of this thread for one call, µs."""
    began_s = time.thread_time()
    for _ in range(calls):
        call()
    return (time.thread_time() - began_s) / calls * 1e6


def time_control_loop_us(call: Callable[[], None]) -> list[float]:
    """Each call of a loop at 1 kHz by the wall clock, µs, sorted."""
    took_us, next_s, end_s = [], time.perf_counter(), time.perf_counter() + LOOP_S
    while next_s < end_s:
        next_s += 0.001
        time.sleep(max(0.0, next_s - time.perf_counter()))
        began_s = time.perf_counter()
        call()
        took_us.append((time.perf_counter() - began_s) * 1e6)
    return sorted(took_us)


def main() -> int:
    """0 when the best window of each way is within what is promised."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--windows", type=int, default=7, help=f"of {CALLS} calls each")
    windows = parser.parse_args().windows
    router = Router()
    router.start()
    pos, ref = dict.fromkeys(JOINTS, 0.1), dict.fromkeys(JOINTS, 0.2)
    q, target = np.full(30, 0.1), np.full(30, 0.2)
    scalars = {name: np.float64(0.1) for name in JOINTS}

    def publish_dict(robot: posecast.Robot) -> None:
        pos["joint_0"] += 0.001
        robot.publish(pos=pos, ref=ref)

    def publish_array(robot: posecast.Robot) -> None:
        q[0] += 0.001
        robot.publish(pos=q, ref=target)

    def publish_scalars(robot: posecast.Robot) -> None:
        scalars["joint_0"] += 0.001
        robot.publish(pos=scalars, ref=scalars)

    ways: dict[str, Callable[[posecast.Robot], None]] = {
        "dict of floats": publish_dict,
        "numpy array": publish_array,
        "dict of numpy scalars": publish_scalars,
    }
    best: dict[str, float] = {}
    for name, publish in ways.items():
        with posecast.Robot(ROBOT, relay=router.endpoint, joints=JOINTS) as robot:
            call = partial(publish, robot)
            call()
            until("on air", lambda r=robot: r.status().frames > 0)  # type: ignore[misc]
            took_us = [time_us(call, CALLS) for _ in range(windows)]
            empty_us = [time_us(lambda: None, CALLS) for _ in range(windows)]
            calls_us = time_control_loop_us(call)
            frames = robot.status().frames
        best[name] = min(took_us)
        print(
            f"{name:22}{best[name]:5.1f} µs a call, median {statistics.median(took_us):.1f} (at most "
            f"{MOST_US:.0f}); {best[name] / min(empty_us):.0f} × an empty call ({min(empty_us):.2f} µs)\n"
            f"{'  at 1 kHz':22}{statistics.median(calls_us):5.1f} µs median, "
            f"{calls_us[int(len(calls_us) * 0.99)]:.0f} p99, "
            f"{calls_us[int(len(calls_us) * 0.999)]:.0f} p99.9, "
            f"{calls_us[-1]:.0f} the longest of {len(calls_us)}; {frames} frames",
            flush=True,
        )
    router.stop()
    return 0 if max(best.values()) <= MOST_US else 1


if __name__ == "__main__":
    sys.exit(main())
