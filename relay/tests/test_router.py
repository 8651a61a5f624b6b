"""The session to which robots connect, in this process: real Zenoh."""

from __future__ import annotations

import asyncio
import json
import re
import resource
import socket
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from datetime import UTC, datetime
from pathlib import Path

import httpx
import pytest
import zenoh
from posecast_relay.zenoh.router import ListenError, RouterSession, ZenohAuth, close_session, read_expiry
from posecast_testing import free_port
from posecast_wire import Credential

from .certificates import KEY, certificates
from .stage import Relay, client_config

LISTEN = ["tcp/127.0.0.1:0"]
SECRET, OTHER = "C" * 43, "-_" + "0" * 41
BEFORE = {"a": SECRET}
AFTER = {"a": SECRET, "b": OTHER}


def lets_in(router: RouterSession, robot: str, secret: str) -> bool:
    """Whether a session can be opened with this credential."""
    config = client_config(router.endpoints[0], Credential(robot, secret))
    config.insert_json5("connect/timeout_ms", "1000")
    try:
        with zenoh.open(config):
            return True
    except zenoh.ZError:
        return False


@pytest.mark.parametrize("name", ["all", "usernames", "0", "x" * 63, "a--", "egress-0", "all-egress-0"])
def test_any_name_and_any_secret_that_a_file_may_have_keeps_nobody_out(name: str) -> None:
    router = RouterSession(LISTEN, ZenohAuth({name: OTHER, "a": SECRET}))
    with router.session:
        assert lets_in(router, name, OTHER)
        assert lets_in(router, "a", SECRET)


class Changes:
    """A session, and what it said of its changes."""

    def __init__(self) -> None:
        self.router = RouterSession(LISTEN, ZenohAuth(BEFORE))
        self.port = int(self.router.endpoints[0].rpartition(":")[2])
        self.said: list[str] = []

    async def admit(self, secrets: dict[str, str]) -> str:
        """Let these robots in; the refusal."""
        try:
            await self.router.admit(
                secrets, lambda: self.said.append("closing"), lambda: self.said.append("opened")
            )
        except ListenError as e:
            return str(e)
        return ""

    async def lets_in(self, robot: str) -> bool:
        """Whether it can connect now."""
        return await asyncio.to_thread(lets_in, self.router, robot, AFTER[robot])


@pytest.fixture
def changes() -> Iterator[Changes]:
    """A session that lets in `a`."""
    made = Changes()
    yield made
    close_session(made.router.session).join()


@contextmanager
def no_folder(gone: Path) -> Iterator[str]:
    """The folder for temporary files was removed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tempfile, "tempdir", str(gone))
        yield f"{gone}: no such file or directory"


@contextmanager
def no_room(_: Path) -> Iterator[str]:
    """No byte can be written to any file."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))
    try:
        yield f"{tempfile.gettempdir()}: file too large"
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("full", [no_folder, no_room])
async def test_without_room_for_its_files_the_session_stays_as_it_is(
    changes: Changes, tmp_path: Path, full: Callable[[Path], AbstractContextManager[str]]
) -> None:
    session = changes.router.session
    with full(tmp_path / "gone") as why:
        for _ in range(2):
            assert await changes.admit(AFTER) == why
    assert (changes.router.session, changes.router.is_listening, changes.said) == (session, True, [])
    assert await changes.lets_in("a")
    assert not await changes.lets_in("b")
    assert await changes.admit(AFTER) == "", "the same robots, now that there is room"
    assert changes.said == ["closing", "opened"]
    assert await changes.lets_in("b")


async def test_robots_can_connect_while_the_next_session_is_made(
    changes: Changes, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, go_on, real = threading.Event(), threading.Event(), zenoh.open

    def open_slowly(config: zenoh.Config) -> zenoh.Session:
        if json.loads(config.get_json("mode")) == "router":
            asked.set()
            go_on.wait()
        return real(config)

    monkeypatch.setattr(zenoh, "open", open_slowly)
    admitted = asyncio.create_task(changes.admit(AFTER))
    await asyncio.to_thread(asked.wait)
    try:
        assert changes.said == []
        assert await changes.lets_in("a")
    finally:
        go_on.set()
    assert await admitted == ""
    assert changes.said == ["closing", "opened"]


async def test_while_another_program_has_the_port_it_says_so_and_then_opens(changes: Changes) -> None:
    close_session(changes.router.session).join()
    with socket.create_server(("127.0.0.1", changes.port)):
        for _ in range(2):
            why = await changes.admit(AFTER)
            assert why.startswith(f"robots can't connect: zenoh listener tcp/127.0.0.1:{changes.port}: addr")
            assert "in use" in why
            assert not changes.router.is_listening
        assert "opened" not in changes.said
    assert not await changes.lets_in("a"), "of the sessions that waited in vain none listens"
    assert await changes.admit(BEFORE) == "", "the robots of before, whose session has closed"
    assert changes.router.is_listening
    assert (await changes.lets_in("a"), await changes.lets_in("b")) == (True, False)


async def test_what_zenoh_refuses_closes_nothing(changes: Changes) -> None:
    assert (await changes.admit(AFTER | {"c": "of two\nlines"})).endswith("invalid format.")
    assert changes.said == []
    assert await changes.lets_in("a")


async def test_a_session_whose_end_fails_or_takes_long_does_not_delay_the_next(changes: Changes) -> None:
    session, ended = changes.router.session, threading.Event()

    class Slow:
        def close(self) -> None:
            session.close()  # type: ignore[no-untyped-call]
            ended.wait()
            raise zenoh.ZError("close operation timed out!")

    changes.router.session = Slow()  # type: ignore[assignment]
    assert await changes.admit(AFTER) == ""
    assert await changes.lets_in("b")
    ended.set()


# ---- when certificates expire: read as openssl reads it, and told by a running relay ----


def make(folder: Path, days: int, extra: str = "") -> Path:
    words = f"req -x509 {KEY} -days {days} -subj /CN=x -keyout {days}.key -out {days}.pem {extra}"
    subprocess.run(["openssl", *words.split()], cwd=folder, check=True, capture_output=True)
    return folder / f"{days}.pem"


def ask_openssl(file: Path) -> float:
    words = ["openssl", "x509", "-in", str(file), "-noout", "-enddate"]
    said = subprocess.run(words, check=True, capture_output=True, text=True).stdout.strip()
    return datetime.strptime(said, "notAfter=%b %d %H:%M:%S %Y GMT").replace(tzinfo=UTC).timestamp()


# a year before 2050 is written with two digits, one after it with four
@pytest.mark.parametrize("days", [1, 3650, 36500])
def test_it_is_what_openssl_says(tmp_path: Path, days: int) -> None:
    certificates(tmp_path)  # skips without openssl
    file = make(tmp_path, days)
    assert read_expiry(file) == ask_openssl(file)


def test_of_a_chain_it_is_the_first_that_expires(tmp_path: Path) -> None:
    certificates(tmp_path)
    long, short = make(tmp_path, 400), make(tmp_path, 20)
    chain = tmp_path / "chain.pem"
    chain.write_text("bag attributes\n" + long.read_text() + short.read_text())
    assert read_expiry(chain) == ask_openssl(short)


@pytest.mark.parametrize("block", ["", "AAAA", "MA==", "MIIBszCCAVmgAwIBAgIU", "…"])
def test_what_is_no_certificate_is_named(tmp_path: Path, block: str) -> None:
    file = tmp_path / "x.pem"
    file.write_text(f"-----BEGIN CERTIFICATE-----\n{block}\n-----END CERTIFICATE-----\n")
    with pytest.raises(ValueError, match=r"can't be read|longer than|no certificate"):
        read_expiry(file)
    file.write_text("nothing of the kind")
    with pytest.raises(ValueError, match=r"x\.pem: contains no certificate"):
        read_expiry(file)


def test_a_running_relay_tells_it(tmp_path: Path, relays: Callable[..., Relay]) -> None:
    certificates(tmp_path)
    robots, port = tmp_path / "robots.toml", free_port()
    robots.touch(0o600)
    robots.write_text("[robots]\n")
    relays(
        *("--robots", str(robots), "--metrics-port", str(port)),
        *("--zenoh-tls-cert", str(tmp_path / "server.pem"), "--zenoh-tls-key", str(tmp_path / "server.key")),
        *("--zenoh-ca", str(tmp_path / "ca.pem")),
        dev=False,
    )
    text = httpx.get(f"http://127.0.0.1:{port}/metrics").text
    line = r"^posecast_certificate_expiry_timestamp_seconds\{flag=\"(.*)\"\} (\S+)$"
    told = {flag: float(value) for flag, value in re.findall(line, text, re.MULTILINE)}
    assert told == {
        "--zenoh-tls-cert": ask_openssl(tmp_path / "server.pem"),
        "--zenoh-ca": ask_openssl(tmp_path / "ca.pem"),
    }
