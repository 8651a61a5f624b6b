"""A relay beside a program that takes the port for robots whenever it is free, as long as a file exists.

`python -m relay.tests.taken_port run …`, as the relay itself. TAKEN names the file, TAKEN_PORT the port.
"""

from __future__ import annotations

import os
import socket
import threading
import time
from pathlib import Path

import zenoh
from posecast_relay import cli
from posecast_relay.zenoh import router


def take_port(session: zenoh.Session) -> threading.Thread:
    """Close the session, and listen in its place before the next one does."""
    closing = close_session(session)
    closing.join()
    file = Path(os.environ["TAKEN"])
    if file.exists():
        taken = socket.create_server(("127.0.0.1", int(os.environ["TAKEN_PORT"])))

        def let_go() -> None:
            with taken:
                while file.exists():
                    time.sleep(0.02)

        threading.Thread(target=let_go).start()
    return closing


if __name__ == "__main__":
    close_session = router.close_session
    router.close_session = take_port
    router.PORT_RETRY = {"period_init_ms": 500, "period_max_ms": 500, "period_increase_factor": 1}
    cli.main()
