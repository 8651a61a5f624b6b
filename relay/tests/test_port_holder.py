"""Who holds a port."""

from __future__ import annotations

import errno
import os
import socket
from pathlib import Path

import pytest
from posecast_relay.runtime.port_holder import explain_taken, name_holder


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
def test_the_program_that_listens_is_named(host: str) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.create_server((host, 0), family=family) as listener:
        named = name_holder(listener.getsockname()[1])
    assert named == f"{Path('/proc/self/comm').read_text().strip()} (process {os.getpid()})"


def test_a_free_port_has_no_holder() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    assert name_holder(port) is None
    assert (
        explain_taken(OSError(errno.EADDRINUSE, "Address already in use"), port) == "address already in use"
    )


def test_a_system_that_tells_nothing(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        assert name_holder(listener.getsockname()[1], tmp_path) is None


def test_other_errors_keep_their_words() -> None:
    assert explain_taken(OSError(errno.EACCES, "Permission denied"), 80) == "permission denied"
