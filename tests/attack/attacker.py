"""One attacker in a separate process, which ends on its own.

python -m tests.attack.attacker NAME HTTP ZENOH SECONDS [SECRET]

Prints READY when it is prepared, attacks once it reads a line on stdin, and prints what it did as JSON.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time

from tests.attack.attacks import ATTACKS
from tests.attack.target import Target

SPARE_S = 6.0


def main(name: str, http: str, zenoh: str, seconds: str, *secret: str) -> None:
    """Ends the process."""
    at = Target(http, zenoh, float(seconds), *secret)
    steps = ATTACKS[name].steps(at)
    next(steps)
    print("READY", flush=True)
    if not sys.stdin.readline():  # its parent is gone
        return
    last = threading.Timer(at.seconds + SPARE_S, os._exit, [1])
    last.daemon = True
    last.start()
    at.end_s = time.monotonic() + at.seconds
    try:
        next(steps)
    except StopIteration as done:
        print(json.dumps({"did": done.value}), flush=True)
    os._exit(0)  # closing a session waits for a relay, which may be held up


if __name__ == "__main__":
    main(*sys.argv[1:])
