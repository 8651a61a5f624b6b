"""What the agent costs beside a robot: a daemon at 200 Hz, through achd or shared memory, 30 frames a second.

    python edge-agent/benches/hubo_ach.py [--windows 5] [--shm]

Prints resident memory, share of a core, and the time from the daemon's write to the frame's arrival at a
Zenoh router. The daemon is a process of its own and writes its clock (CLOCK_MONOTONIC) into the frame; the
wire rounds it to a millisecond. What else the machine does only adds, so of several windows the best counts;
how long a step of a plain Python loop takes meanwhile says how fast the machine is.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests"))

from ach_stage import Writer  # noqa: E402
from achd_stage import Achd  # noqa: E402
from edge_stage import ROBOT, Edge, Got, Router  # noqa: E402
from hubo_structs import SLOT, state  # noqa: E402
from posecast_testing import until  # noqa: E402
from posecast_wire.decoder import Decoder  # noqa: E402
from posecast_wire.frame import FrameError  # noqa: E402
from posecast_wire.keys import Snapshot  # noqa: E402

PERIOD_S = 0.005
SETTLE_S = 3.0
WINDOW_S = 4.0
MOST_RSS_MB, MOST_CPU, MOST_P99_MS = 40, 0.03, 5


def daemon(shm: str) -> None:
    """Every joint moves, every 5 ms, until stdin ends."""
    if shm:
        put: Callable[[bytes], None] = Writer(Path(shm)).put
        print(f"hubo-ach:shm:{shm}", flush=True)
    else:
        server = Achd()
        put = server.publish
        print(server.source, flush=True)
    robot = state()
    next_s = time.monotonic()
    k = 0
    while os.getppid() != 1:
        next_s = max(next_s + PERIOD_S, time.monotonic())
        time.sleep(max(0.0, next_s - time.monotonic()))
        k += 1
        for i in SLOT.values():
            robot.joint[i].ref = ((k + 7 * i) % 400 - 200) / 200
            robot.joint[i].pos = ((k + 7 * i - 9) % 400 - 200) / 200
            robot.joint[i].cur = (k * i % 100) / 50
        robot.time = time.monotonic()
        put(bytes(robot))


def cpu_s(pid: int) -> float:
    """Time on a processor so far, over all threads, by the scheduler's clock: the one in `stat` counts whole
    ticks, and a process that wakes with the tick is charged for all of it."""
    tasks = Path(f"/proc/{pid}/task").glob("*/schedstat")
    return sum(int(task.read_text().split()[0]) for task in tasks) / 1e9


def rss_mb(pid: int) -> float:
    """Resident memory now."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def main() -> int:
    """0 when the figures are within what is promised."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--windows", type=int, default=5, help=f"of {WINDOW_S:g} s each")
    parser.add_argument("--shm", action="store_true", help="shared memory instead of achd")
    parser.add_argument("--daemon", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.daemon is not None:
        daemon(args.daemon)
        return 0
    with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:  # where channels are
        path = f"{folder}/achshm-hubo-state" if args.shm else ""
        command = [sys.executable, __file__, "--daemon", path]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as robot:
            assert robot.stdout is not None
            try:
                return measure(robot.stdout.readline().strip(), args.windows)
            finally:
                robot.kill()


def loop_step_ns() -> float:
    """The speed of this machine now: a step of a plain loop."""
    began_s = time.perf_counter()
    for _ in range(200_000):
        pass
    return (time.perf_counter() - began_s) / 200_000 * 1e9


def measure(source: str, windows: int) -> int:
    """Run the agent and print its figures, each the best of the windows."""
    router = Router()
    router.start()
    flags = ("--robot", ROBOT, "--source", source, "--relay", router.endpoint, "--profile", "hubo2plus")
    edge = Edge("run", *flags, stdin=False)
    try:
        until("frames", lambda: len(router.frames) > 30)
        time.sleep(SETTLE_S)
        pid = edge.process.pid
        sample = router.snapshot()
        assert sample is not None
        schema = Snapshot.unpack(sample.payload.to_bytes()).schema
        cpu, p50, p99, rate, size, step_ns = [], [], [], [], [], []
        for _ in range(windows):
            began, began_s, began_cpu_s = len(router.frames), time.monotonic(), cpu_s(pid)
            for _ in range(
                round(WINDOW_S)
            ):  # what others do in the caches is charged to us: the calmest second
                time.sleep(1.0)
                now_s, now_cpu_s = time.monotonic(), cpu_s(pid)
                cpu.append((now_cpu_s - began_cpu_s) / (now_s - began_s))
                began_s, began_cpu_s = now_s, now_cpu_s
            frames = router.frames[began:]
            late_ms = lateness_ms(schema, router.frames, began)
            p50.append(statistics.median(late_ms))
            p99.append(late_ms[int(len(late_ms) * 0.99)])
            rate.append(len(frames) / WINDOW_S)
            size.append(statistics.mean(len(f.data) for f in frames))
            step_ns.append(loop_step_ns())
        rss = rss_mb(pid)
    finally:
        edge.kill()
        router.stop()
    print(f"source      hubo-ach, {'shared memory' if 'shm:' in source else 'achd'}, 200 Hz")
    print(f"machine     {min(step_ns):.0f} to {max(step_ns):.0f} ns a step of a plain loop")
    print(f"frames      {statistics.mean(rate):.1f} a second, {statistics.mean(size):.0f} B")
    print(f"memory      {rss:.1f} MB resident (at most {MOST_RSS_MB})")
    usual = statistics.median(cpu) * 100
    print(f"processor   {min(cpu) * 100:.2f} % of a core, median {usual:.2f} (at most {MOST_CPU * 100:.0f})")
    print(f"to Zenoh    {min(p50):.1f} ms median, {min(p99):.1f} p99 (at most {MOST_P99_MS})")
    return 0 if rss <= MOST_RSS_MB and min(cpu) <= MOST_CPU and min(p99) <= MOST_P99_MS else 1


def lateness_ms(schema: str, frames: list[Got], since: int) -> list[float]:
    """From the daemon's clock to the arrival, sorted, of the frames from the `since`-th on."""
    decoder = Decoder()
    decoder.add_schema(schema)
    found = []
    for i, frame in enumerate(frames):
        with suppress(FrameError):  # before the first KEY
            decoded = decoder.decode(frame.data)
            if i >= since:
                found.append((frame.at_s - decoded.t_s) * 1e3)
    return sorted(found)


if __name__ == "__main__":
    sys.exit(main())
