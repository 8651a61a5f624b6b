"""The relay's side of a thin uplink, run inside a network namespace: `python uplink_router.py HOST:PORT`.

Prints a line for each frame: monotonic seconds of its arrival, the robot's clock in it, its size. Answers the
echo as a relay does.
"""

from __future__ import annotations

import sys
import time

from edge_stage import ROBOT, Router
from posecast_wire.decoder import Decoder
from posecast_wire.frame import FrameError
from posecast_wire.keys import Echo


def main() -> None:
    router = Router(host=sys.argv[1])
    router.start()
    newest = Echo(0, 0, 0.0)
    router.echo = lambda: newest
    print(router.endpoint, flush=True)
    decoder: Decoder | None = None
    told = 0
    while True:
        time.sleep(0.005)
        frames = router.frames
        if len(frames) > told and decoder is None:
            decoder = router.decoder()
        while decoder is not None and told < len(frames):
            frame = frames[told]
            told += 1
            try:
                decoded = decoder.decode(frame.data)
            except FrameError:
                continue
            newest = Echo(frame.stamp.run_id, decoded.seq, time.time())
            print(f"{frame.at_s:.4f} {decoded.t_s:.4f} {len(frame.data)}", flush=True)


if __name__ == "__main__":
    assert ROBOT
    main()
