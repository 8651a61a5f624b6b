"""The next free port."""

from __future__ import annotations

import socket

import pytest
from posecast_command import ports
from posecast_command.ports import PortError, find_free_port, is_taken


def test_a_taken_port_is_passed_over() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert is_taken("127.0.0.1", port)
        assert find_free_port("127.0.0.1", port) > port
    assert not is_taken("127.0.0.1", port)


def test_a_listener_on_all_addresses_has_the_port_too() -> None:
    with socket.create_server(("0.0.0.0", 0)) as taken:
        assert is_taken("127.0.0.1", taken.getsockname()[1])


def test_there_is_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ports, "TRIES", 1)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(PortError, match=f"^ports {port} to {port} of 127.0.0.1 are all in use$"):
            find_free_port("127.0.0.1", port)


def test_a_host_that_is_not_of_this_machine_is_left_to_the_relay() -> None:
    assert not is_taken("192.0.2.1", 8080)
