"""The addresses of sources that are reached over a network, and what they say without their extra."""

from __future__ import annotations

import importlib.util
import re

import pytest
from posecast_edge.sample import SourceError
from posecast_edge.sources.registry import open_source
from posecast_wire.command_line.installation import advise_extra

NONE = {
    "ros2": ("host name", "host:99999", "tcp/127.0.0.1:7447", "://x", "host/a b", "host:7447/a//b"),
    "rosbridge": ("", "host name", "host:99999", "http://host", "host?x=1"),
    "hubo-ach": ("", "host:port", "a b", "host:0", "host:70000", "/dev/shm/x", "h:1:2"),
}
DESCRIPTIONS = {
    "ros2": "ros2 localhost:7447",
    "ros2:robot": "ros2 robot:7447",
    "ros2://robot": "ros2 robot:7447",
    "ros2://robot:1234/r1/": "ros2 robot:1234/r1",
    "ros2:[::1]:1234": "ros2 [::1]:1234",
    "rosbridge:robot": "rosbridge ws://robot:9090",
    "rosbridge://robot:80/ros": "rosbridge ws://robot:80/ros",
    "rosbridge:ws://[::1]": "rosbridge ws://[::1]:9090",
    "rosbridge:wss://robot.example/ros": "rosbridge wss://robot.example:443/ros",
    "hubo-ach:10.0.0.5": "hubo-ach 10.0.0.5:8076",
    "hubo-ach:hubo.local:9000": "hubo-ach hubo.local:9000",
    "hubo-ach:[fe80::1%eth0]:8076": "hubo-ach fe80::1%eth0:8076",
    "hubo-ach:shm": "hubo-ach /dev/shm/achshm-hubo-state",
    "hubo-ach:shm:/mnt/shm/x": "hubo-ach /mnt/shm/x",
}
LACKS = {"ros2": "ros2: its decoder is not installed; ", "rosbridge:robot": "rosbridge needs .*: "}


@pytest.mark.parametrize("spec", [f"{kind}:{address}" for kind, some in NONE.items() for address in some])
def test_an_address_that_is_none(spec: str) -> None:
    with pytest.raises(SourceError, match=f"^{spec.partition(':')[0]}: .* is not an address(;| such as)"):
        open_source(spec, None)


@pytest.mark.parametrize("spec", DESCRIPTIONS)
def test_an_address(spec: str) -> None:
    assert open_source(spec, None).description == DESCRIPTIONS[spec]


@pytest.mark.parametrize("spec", LACKS)
def test_without_the_extra_it_says_what_to_install(spec: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(
        SourceError, match=f"^{LACKS[spec]}{re.escape(advise_extra('posecast-edge', 'ros'))}$"
    ):
        open_source(spec, None)
