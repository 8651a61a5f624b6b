"""A credential or certificate that is replaced while the agent runs: real Zenoh over TLS, the real agent."""

from __future__ import annotations

import asyncio
import shutil
import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import zenoh
from posecast_testing import until
from posecast_wire import Credential

from . import test_client_certificates as certified
from .stage import Relay, Watcher, client_config
from .test_publishers import Agent, Lab
from .test_redis_slow import SlowLine

TAKEN = "the new credential is in use"


@pytest.fixture
def lab(tmp_path: Path, relays: Callable[..., Relay]) -> Lab:
    """Not started: robots may be enrolled first."""
    return Lab(tmp_path, relays)


def run(what: str, probe: Callable[[], object]) -> Any:
    """Wait for something beside viewers that go on to read."""
    return asyncio.to_thread(until, what, probe, 30.0)


def list_words(viewer: Watcher) -> set[str]:
    """What the viewer was told of the robot."""
    return {str(status["robot"]) for status in viewer.told("status")}


def replace(file: Path, text: str) -> None:
    """Lay another text in the place of a file, as `mv` does."""
    newer = file.with_suffix(".new")
    newer.write_text(text)
    newer.chmod(0o600)
    newer.replace(file)


def is_let_in(lab: Lab, credential: Credential) -> bool:
    """Whether the relay takes it."""
    config = client_config(lab.relay.zenoh, credential)
    config.insert_json5("connect/timeout_ms", "1000")
    try:
        with zenoh.open(config):
            return True
    except zenoh.ZError:
        return False


def is_beyond(edge: Agent, url: str, seq: int) -> bool:
    """Whether the relay has a frame that is newer than `seq`."""
    return (edge.seq(url) or 0) > seq


async def test_a_rotation_in_two_steps_leaves_no_gap(lab: Lab, tmp_path: Path) -> None:
    old = lab.credential("hubo")
    relay = lab.start()
    with Agent(lab, tmp_path, old) as edge:
        async with Watcher(relay.url("hubo")) as viewer:
            await viewer.until("frames", lambda v: len(v.frames) > 10, 30.0)
            began = len(viewer.texts)
            line = await asyncio.to_thread(lab.robots, "rotate", "hubo", "--begin")
            newer = Credential.parse(line)
            assert newer.secret != old.secret
            replace(tmp_path / "credential", line)
            await run("it is tried", lambda: "does not accept the new credential yet" in edge.errors())
            seen = len(viewer.frames)
            await viewer.until("the robot goes on", lambda v: len(v.frames) > seen + 30)
            assert await asyncio.to_thread(is_let_in, lab, old)

            await asyncio.to_thread(lab.robots, "rotate", "hubo", "--finish")
            await run("the relay follows", lambda: lab.told("with a new credential: hubo"))
            await run("the new one is in use", lambda: TAKEN in edge.errors())
            assert not await asyncio.to_thread(is_let_in, lab, old)
            assert await asyncio.to_thread(is_let_in, lab, newer)
            seen = len(viewer.frames)
            await viewer.until("the robot goes on by it", lambda v: len(v.frames) > seen + 30)
            viewer.texts = viewer.texts[began:]
            assert list_words(viewer) == {"online"}, "the robot was never away"
            assert viewer.closed is None
    for secret in (old.secret, newer.secret):
        assert secret not in edge.errors() + relay.errors()


def test_a_credential_that_was_rotated_at_once_is_taken_from_the_file(lab: Lab, tmp_path: Path) -> None:
    relay_credential = lab.credential("hubo")
    relay = lab.start()
    url = f"http://{relay.address}/api/v1/robots"
    with Agent(lab, tmp_path, relay_credential) as edge:
        until("on air", lambda: edge.seq(url) is not None, 20.0)
        line = lab.robots("rotate", "hubo")
        until("the relay follows", lambda: lab.told("with a new credential: hubo"))
        seq = edge.seq(url) or 0
        replace(tmp_path / "credential", line)
        until("the new one is in use", lambda: TAKEN in edge.errors(), 20.0)
        until("on air again", partial(is_beyond, edge, url, seq + 30), 20.0)


def test_what_is_wrong_in_the_file_changes_nothing(lab: Lab, tmp_path: Path) -> None:
    credential, other = lab.credential("hubo"), lab.credential("other")
    relay = lab.start()
    url = f"http://{relay.address}/api/v1/robots"
    with Agent(lab, tmp_path, credential) as edge:
        until("on air", lambda: edge.seq(url) is not None, 20.0)
        for text, says in (
            (other.line(), "it is for robot 'other', not for 'hubo'; keeping the previous one"),
            ("posecast1:hubo:cut\n", "its secret is cut short or mistyped; keeping the previous"),
        ):
            replace(tmp_path / "credential", text)
            until("it says so", partial(_says, edge, says), 20.0)
        seq = edge.seq(url) or 0
        replace(tmp_path / "credential", credential.line())  # what it has
        until("the robot goes on", partial(is_beyond, edge, url, seq + 60), 20.0)
        assert TAKEN not in edge.errors()
        assert "keeping the previous one" in edge.errors()


def _says(edge: Agent, what: str) -> bool:
    return what in edge.errors()


async def test_a_certificate_that_is_renewed_in_place_leaves_no_gap(
    tmp_path: Path, relays: Callable[..., Relay]
) -> None:
    lab = certified.Lab(tmp_path, relays)
    chain, key = lab.certificate("hubo")
    lab.robots("add", "hubo", "--certificate")
    relay = lab.start()
    errors = tmp_path / "edge.err"
    async with SlowLine(relay.zenoh_port).open() as line:
        edge = lab.agent(relay, "hubo", (chain, key), errors, f"tls/127.0.0.1:{line.port}")
        try:
            async with Watcher(relay.url("hubo")) as viewer:
                await viewer.until("frames", lambda v: len(v.frames) > 10, 30.0)
                viewer.texts.clear()
                line.further_s = 0.15  # the old session's end would overtake what the new one says
                for new, old in zip(lab.certificate("hubo"), (chain, key), strict=True):
                    shutil.move(new, old)
                await run("the new one is in use", lambda: TAKEN in errors.read_text())
                seen = len(viewer.frames)
                await viewer.until("the robot goes on", lambda v: len(v.frames) > seen + 30)
                assert list_words(viewer) == {"online"}, "the robot was never away"

                for new, old in zip(lab.certificate("nobody"), (chain, key), strict=True):
                    shutil.move(new, old)
                await run("it is not taken", lambda: "accept the new credential yet" in errors.read_text())
                seen = len(viewer.frames)
                await viewer.until("the robot goes on", lambda v: len(v.frames) > seen + 30)
                assert errors.read_text().count(TAKEN) == 1
        finally:
            await asyncio.to_thread(end, edge)


def end(edge: subprocess.Popen[bytes]) -> None:
    edge.terminate()
    edge.wait(15)
