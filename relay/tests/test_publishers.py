"""Who may publish: real Zenoh over TLS, real credentials, the real agent."""

from __future__ import annotations

import asyncio
import json
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from functools import partial
from itertools import pairwise
from pathlib import Path
from secrets import token_urlsafe
from typing import Any

import httpx
import pytest
import zenoh
from posecast_testing import Process, until
from posecast_wire import Credential, alive_key, echo_key, event_key, frame_key, snapshot_key

from .certificates import certificates
from .command import run_command
from .stage import Relay, Watcher, client_config


class Lab:
    """A relay with TLS and a file of robots, and what edges are given."""

    def __init__(self, folder: Path, relays: Callable[..., Relay]) -> None:
        certificates(folder)
        self.folder = folder
        self.file = folder / "robots.toml"
        self._relays = relays
        self.relay: Relay

    def robots(self, *words: str) -> str:
        """`posecast-relay robots …`; what it prints."""
        authority = ("--ca", str(self.folder / "ca.pem")) if words[0] in ("add", "rotate") else ()
        done = run_command("robots", *words, "--robots", str(self.file), *authority)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def credential(self, robot: str) -> Credential:
        """Enrol it."""
        return Credential.parse(self.robots("add", robot))

    def start(self, **how: Any) -> Relay:
        """With its metrics on a port of their own."""
        self.relay = self._relays(
            *("--robots", str(self.file), "--metrics-port", "0", "--log-level", "info"),
            *("--zenoh-tls-cert", str(self.folder / "server.pem")),
            *("--zenoh-tls-key", str(self.folder / "server.key")),
            dev=False,
            **how,
        )
        return self.relay

    def told(self, line: str) -> bool:
        """Whether the relay has logged it."""
        return re.search(line, self.relay.errors()) is not None

    def figure(self, name: str) -> float:
        """Of the relay's metrics; summed over labels."""
        port = until(
            "the metrics' port", lambda: re.search(r"metrics on http://[^:]+:(\d+)", self.relay.errors())
        )
        text = httpx.get(f"http://127.0.0.1:{port[1]}/metrics").text
        return sum(float(value) for value in re.findall(rf"^{name}(?:{{.*}})? (\S+)$", text, re.MULTILINE))


@pytest.fixture
def lab(tmp_path: Path, relays: Callable[..., Relay]) -> Lab:
    """Not started: robots may be enrolled first."""
    return Lab(tmp_path, relays)


def session_of(lab: Lab, credential: Credential | None) -> zenoh.Session:
    """A session as an edge has it, with nothing declared."""
    return zenoh.open(client_config(lab.relay.zenoh, credential))


def test_a_credential_writes_its_own_keys_and_reads_nothing_but_its_own_echo(
    lab: Lab, edges: Callable[..., Any]
) -> None:
    own, other = lab.credential("mine"), lab.credential("other")
    relay = lab.start()
    robot = edges(relay.zenoh, robot="other", credential=other)
    list_url = f"http://{relay.address}/api/v1/robots"
    until("the other is on air", lambda: httpx.get(f"{list_url}/other/state").status_code == 200)

    heard: list[str] = []
    with session_of(lab, own) as ear, session_of(lab, own) as session:  # a session always hears itself
        keep: list[object] = [
            ear.declare_subscriber("**", lambda sample: heard.append(f"sample {sample.key_expr}")),
            ear.declare_subscriber("posecast/v1/other/**", lambda s: heard.append(f"sample {s.key_expr}")),
            ear.liveliness().declare_subscriber(
                "**", lambda s: heard.append(f"token {s.key_expr}"), history=True
            ),
            ear.declare_queryable("**", lambda query: heard.append(f"query {query.key_expr}")),
            ear.declare_queryable(
                snapshot_key("other", "public"), lambda query: heard.append(f"query {query.key_expr}")
            ),
            session.liveliness().declare_token(alive_key("third")),
        ]
        # what another robot would say, said by this one; then something of its own, which comes after it
        false = robot.edge.frame(time.monotonic(), force_key=True)
        stamp = robot.edge.stamp(time.monotonic())._replace(run_id=0xBAD).pack()
        doc = {"type": "event", "t": 1.0, "level": "fault", "source": "x", "text": "CANARY", "state": "on"}
        for name in ("other", "third"):
            session.put(frame_key(name, "public"), false, attachment=stamp)
            session.put(event_key(name, "public"), json.dumps(doc), attachment=stamp)
        session.put("posecast/v1/other/public/snapshot", b"x", attachment=stamp)
        session.put("anything/else", b"x")
        mine = event_key("mine", "public")
        session.put(mine, json.dumps(doc | {"text": "mine"}), attachment=stamp)
        keep.append(session.liveliness().declare_token(alive_key("mine")))  # with it, it is listed
        until("its own edge is seen", lambda: "mine" in [r["robot"] for r in _robots(list_url)])

        assert _asked(session, echo_key("mine")) == [echo_key("mine")]
        for selector in (
            echo_key("other"),
            "posecast/v1/other/**",
            "posecast/v1/*/echo",
            "posecast/**",
            "**",
        ):
            assert _asked(session, selector) in ([], [echo_key("mine")]), selector
        tokens = [str(r.ok.key_expr) for r in ear.liveliness().get("**", timeout=1.0) if r.ok is not None]
        assert tokens == []

        seq = robot.seq
        until("the other has gone on", lambda: robot.seq > seq + 5)
        assert heard == []
        assert [r["robot"] for r in _robots(list_url)] == ["mine", "other"]
        found = httpx.get(f"{list_url}/other").json()
        assert found["conflict"] is False
        echo = robot.echo()
        assert echo is not None
        assert echo.run_id == robot.edge.run_id
        del keep
    assert "CANARY" not in relay.errors()


def _robots(url: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = httpx.get(url).json()["robots"]
    return found


def _asked(session: zenoh.Session, selector: str) -> list[str]:
    return [str(r.ok.key_expr) for r in session.get(selector, timeout=1.0) if r.ok is not None]


def test_whoever_is_not_let_in_is_told_at_both_ends(lab: Lab, tmp_path: Path) -> None:
    good = lab.credential("hubo")
    old = lab.credential("old")
    text = lab.file.read_text()
    lab.file.write_text(text.replace("[robots.old]\n", "[robots.old]\nexpires = 2020-01-01T00:00:00Z\n"))
    lab.start()
    locked = "refuses '{}': its credential is wrong, expired or revoked"
    untrusted = "a certificate that can't be trusted"
    strangers = {
        "wrong": (Credential("hubo", "x" * 43, good.ca), locked.format("hubo")),
        "unknown": (Credential("g1", good.secret, good.ca), locked.format("g1")),
        "expired": (old, locked.format("old")),
        "none": (None, untrusted),
        "no authority": (Credential("hubo", good.secret), untrusted),
    }
    with ExitStack() as running:
        edges = {}
        for name, (credential, _) in strangers.items():
            (tmp_path / name).mkdir()
            edges[name] = running.enter_context(Agent(lab, tmp_path / name, credential))
        for name, (_, says) in strangers.items():
            until(f"{name}: the edge says why", partial(_says, edges[name], says), 30.0)
        until("the relay says why", lambda: lab.told(r"publisher refused \(\d+ so far\): "))
        until("they are counted", lambda: lab.figure("posecast_publishers_refused_total") >= 3)
    for edge in edges.values():
        assert edge.errors().count("still trying") == 1
        assert good.secret not in edge.errors()
    assert good.secret not in lab.relay.errors()
    assert _robots(f"http://{lab.relay.address}/api/v1/robots") == []


def _says(edge: Agent, what: str) -> bool:
    return what in edge.errors()


def test_enrolling_one_costs_others_one_frame_and_revoking_ends_it(lab: Lab, tmp_path: Path) -> None:
    lab.robots("add", "before")
    relay = lab.start()
    url = f"http://{relay.address}/api/v1/robots"
    with Agent(lab, tmp_path, lab.credential("hubo")) as edge:
        until("on air", lambda: edge.seq(url) is not None, 20.0)
        until("the relay has noticed the first enrolment", lambda: lab.told("enrolled: hubo"))

        before = missing(lab, edge, url)
        seq = edge.seq(url) or 0
        lab.robots("add", "g1")
        until("it is enrolled", lambda: lab.told("enrolled: g1"))
        until("the robot goes on", lambda: (edge.seq(url) or 0) > seq + 60, 20.0)
        assert missing(lab, edge, url) - before <= 1
        until("it is still there", lambda: _robots(url)[0]["status"] == "online")

        lab.robots("remove", "hubo")
        until("nobody sees it any more", lambda: _robots(url) == [], 20.0)
        until("the edge says why", lambda: "wrong, expired or revoked" in edge.errors(), 20.0)
        until("so does the relay", lambda: lab.told("publisher refused"))

        assert "common name" not in relay.errors(), "passwords are shown here"

        again = lab.credential("hubo")
        assert again.secret not in relay.errors()


async def test_a_file_that_is_rewritten_twenty_times_is_not_seen_by_another_robots_viewers(
    lab: Lab, tmp_path: Path
) -> None:
    credential = lab.credential("hubo")
    relay = lab.start()
    before = lab.file.read_text()
    with Agent(lab, tmp_path, credential) as edge:
        async with Watcher(relay.url("hubo")) as viewer:
            await viewer.until("frames", lambda v: len(v.frames) > 30)
            since, known = viewer.frames[-1][1].seq, len(viewer.told("status"))
            for n in range(20):  # one robot comes, and one goes
                other = Credential(f"other-{n}", token_urlsafe(32), credential.ca)
                enrolled = f"{before}\n[robots.{other.robot}]\nsecret = '{other.secret}'\n"
                lab.file.write_text(enrolled)
                await asyncio.to_thread(until, "it is let in", partial(is_let_in, lab, other), 60.0)
                seq = viewer.frames[-1][1].seq
                await viewer.until("the robot goes on", lambda v, seq=seq: v.frames[-1][1].seq > seq + 5)  # type: ignore[misc]
            assert edge.errors().count("linked to") <= 21, "once more for each change"
            assert {each["robot"] for each in viewer.told("status")[known:]} == {"online"}
            assert viewer.most_missed(since) < 30, "a second"
            times_s = [at_s for at_s, frame in viewer.frames if frame.seq >= since]
            print(f"longest gap: {1000 * max(b - a for a, b in pairwise(times_s)):.0f} ms")  # with pytest -s
            assert "robot hubo gone" not in relay.errors()


def is_let_in(lab: Lab, credential: Credential) -> bool:
    """Whether a session can be opened with it."""
    try:
        with session_of(lab, credential):
            return True
    except zenoh.ZError:
        return False


def missing(lab: Lab, edge: Agent, url: str) -> int:
    """Frames that were numbered and never came, counted while the program pauses and none is under way."""
    edge.paused.set()
    seen: list[tuple[int, int]] = []

    def settled() -> bool:
        arrived = round(lab.figure("posecast_edge_frames_total"))
        seen.append(((edge.seq(url) or 0) + 1, arrived))
        return len(seen) > 20 and len(set(seen[-20:])) == 1  # answers are a tenth of a second old at most

    until("nothing is under way", settled, 30.0)
    edge.paused.clear()
    numbered, arrived = seen[-1]
    return numbered - arrived


class Agent(Process):
    """`posecast-edge` with a moving knee on its stdin."""

    def __init__(self, lab: Lab, folder: Path, credential: Credential | None) -> None:
        flags = ["--robot", "hubo"]
        if credential is not None:
            file = folder / "credential"
            file.write_text(credential.line() + "\n")
            file.chmod(0o600)
            flags = ["--robot", credential.robot, "--credential", str(file)]
        command = (str(Path(sys.executable).parent / "posecast-edge"), "run", *flags, "--source", "jsonl")
        super().__init__(folder, "edge", *command, "--relay", lab.relay.zenoh, stdin=subprocess.PIPE)
        self._stop = threading.Event()
        self.paused = threading.Event()
        self._thread = threading.Thread(target=self._move, daemon=True)
        self._thread.start()

    def _move(self) -> None:
        stdin = self.process.stdin
        assert stdin is not None
        with suppress(BrokenPipeError):
            while not self._stop.wait(1 / 30):
                t_s = time.monotonic()
                if self.paused.is_set():
                    continue
                stdin.write(json.dumps({"t": t_s, "pos": {"RKN": round(t_s % 2.0, 3)}}).encode() + b"\n")
                stdin.flush()

    def seq(self, url: str) -> int | None:
        """The newest that the relay has."""
        answer = httpx.get(f"{url}/hubo/state")
        return answer.json()["seq"] if answer.status_code == 200 else None

    def __enter__(self) -> Agent:
        return self

    def __exit__(self, *error: object) -> None:
        self._stop.set()
        self._thread.join()
        self.stop()


def test_without_a_certificate_or_a_file_there_is_no_start(tmp_path: Path) -> None:
    file = tmp_path / "robots.toml"
    assert "give --robots FILE" in _refused()
    file.write_text("")
    for endpoint, says in (
        ("tls/127.0.0.1:0", "needs a certificate"),
        ("tcp/0.0.0.0:0", "use tls/… or quic/… for other machines"),
    ):
        assert says in _refused("--robots", str(file), "--zenoh-listen", endpoint)


def _refused(*flags: str) -> str:
    done = run_command("run", "--port", "0", *flags)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    return done.stderr
