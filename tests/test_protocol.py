"""The protocol page, followed step by step: every example runs, every sample is complete."""

from __future__ import annotations

import hashlib
import json
import re
import shlex
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import until

from tests.conftest import BIN, Stack
from tests.doc_blocks.block import read_blocks

PAGE = (Path(__file__).resolve().parent.parent / "docs" / "reference/protocol.md").read_text()
ADDRESS = "127.0.0.1:8080"  # where the page says the demo is
WIRE = Path(__file__).resolve().parent.parent / "wire"
SEGMENTS = WIRE / "vectors" / "segments"
BYTES = {"content-type": "application/octet-stream"}
Answer = tuple[int, dict[str, str], bytes]
HANG_UP: Answer = (0, {}, b"")
ENDS_MS = 1764000004701  # when the second of the segments there ended
LINES = 3  # of an example's output: it goes on


def block(language: str, holding: str) -> str:
    """The single block in that language that contains this."""
    (found,) = read_blocks("docs/reference/protocol.md", language, holding)
    return found


def sample(holding: str) -> Any:
    """A sample answer of the page."""
    return json.loads(block("json", holding))


@pytest.mark.docs
def test_the_page_has_every_close_code() -> None:
    endings = json.loads((WIRE / "closes.json").read_text())
    for each in endings:
        row = f"| {each['code']} | {each['name']} | {each['meaning']} | `{each['retry']}` |"
        assert row in PAGE, row
    rules = re.findall(r"^\| `(\w+)` \| (?:after|not) ", PAGE, re.MULTILINE)
    assert set(rules) == {each["retry"] for each in endings}


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Where a relay serves the moving demo robot, for all tests of this file."""
    stack = Stack(tmp_path_factory.mktemp("demo"))
    _, address, zenoh = stack.relay(flags=("--past", "memory:"))
    stack.edge(zenoh, "--source", "demo")

    def has_state() -> bool:
        with suppress(urllib.error.URLError):
            state = get(address, "/api/v1/robots/demo/state")
            return bool(state["fields"]) and get(address, "/api/v1/robots/demo")["model"] is not None
        return False

    until("the demo has a state, and a model", has_state)
    yield address
    for part in reversed(stack.parts):
        part.stop()
        assert "Traceback" not in part.log, part.log


def get(address: str, path: str) -> Any:
    """The answer, which any page may read."""
    with urllib.request.urlopen(f"http://{address}{path}", timeout=10) as answer:
        assert answer.headers["access-control-allow-origin"] == "*"
        return json.load(answer)


def first_lines(stack: Any, name: str, *command: str) -> list[str]:
    """The first output of this endless program."""
    part = stack.start(name, *command)
    return str(part.line(rf"(?:.*\n){{{LINES}}}")[0]).splitlines()


@pytest.mark.parametrize("line", block("sh", "curl").splitlines())
def test_curl(line: str, demo: str, stack: Any) -> None:
    command = [word.replace(ADDRESS, demo) for word in shlex.split(line)]
    if "-sN" in command:
        part = stack.start("curl", *command)
        message = json.loads(part.line(r"event: frame\ndata: (.*)\n")[1])
        assert message["values"]["pos"]
    else:
        answer = json.loads(subprocess.run(command, capture_output=True, check=True, timeout=20).stdout)
        assert "demo" in json.dumps(answer)


@pytest.mark.parametrize("name", ["watch.py", "frames.py"])
def test_python(name: str, demo: str, stack: Any, tmp_path: Path) -> None:
    program = tmp_path / name
    program.write_text(block("python", f"# {name}").replace(ADDRESS, demo))
    lines = first_lines(stack, "python", sys.executable, str(program))
    assert len(set(lines)) == LINES  # it moves


def test_the_past(demo: str, stack: Any, tmp_path: Path) -> None:
    past = "/api/v1/robots/demo/past"
    until("there is a past", lambda: get(demo, past)["newest"])
    program = tmp_path / "past.py"
    program.write_text(block("python", "# past.py").replace(ADDRESS, demo))
    part = stack.start("past", sys.executable, str(program))
    whole: list[dict[str, Any]] = []  # the segments of which it has told each frame

    def goes_on() -> bool:
        assert part.process.poll() is None, part.log
        seqs = [int(line.split()[1]) for line in part.out.splitlines()]
        done = {*seqs}
        whole[:] = [s for s in listed(demo, past) if s["frames"] and {s["first_seq"], s["last_seq"]} <= done]
        return len(whole) > 1

    until("it goes on with the next segment", goes_on)
    seqs = [int(line.split()[1]) for line in part.out.splitlines()]
    assert seqs == sorted({*seqs})
    for segment in whole:  # a busy machine may lose a frame before it is recorded
        told = [seq for seq in seqs if segment["first_seq"] <= seq <= segment["last_seq"]]
        assert len(told) == segment["frames"]
    for before, after in pairwise(whole):  # and nothing is lacking between two segments
        assert after["first_seq"] - before["last_seq"] - 1 == after["missing"]
    assert sample('"past_ms"').keys() == get(demo, past).keys()
    assert whole[0].keys() == sample('"first_seq"')["segments"][0].keys()
    day = get(demo, f"{past}/public/{get(demo, past)['days'][-1]}")
    assert day.keys() == sample('"minutes"').keys()
    assert day["minutes"][-1].keys() == sample('"minutes"')["minutes"][0].keys()


def test_the_reader_of_the_past_waits_as_it_is_told_and_asks_for_nothing_twice(
    stack: Any, tmp_path: Path
) -> None:
    text = (SEGMENTS / "schema.json").read_bytes()
    take, schema = "c0ffee0123456789", hashlib.sha256(text).hexdigest()
    later = (204, {"retry-ms": "300"}, b"")
    zero, one, two, four, six, seven = (f"/public/{take}/{index}" for index in (0, 1, 2, 4, 6, 7))
    script: list[tuple[str, Answer]] = [
        ("", tell({"newest": None, "to_ms": None})),
        *(("", answer) for answer in ((404, {}, b""), (503, {"retry-after": "1"}, b""), HANG_UP)),
        ("", tell({"newest": {"take": take, "index": 0}, "to_ms": ENDS_MS})),
        *((zero, answer) for answer in (later, HANG_UP)),
        (zero, (200, BYTES, (SEGMENTS / "key.pcs").read_bytes())),
        (f"/public/schema/{schema}", (503, {}, b"")),
        (zero, (200, BYTES, (SEGMENTS / "key.pcs").read_bytes())),
        (f"/public/schema/{schema}", (200, {"content-type": "application/json"}, text)),
        (one, (200, BYTES, (SEGMENTS / "copies.pcs").read_bytes())),
        (two, (404, {}, b"")),
        ("", tell({"newest": {"take": take, "index": 0}, "to_ms": ENDS_MS})),  # it has that
        (two, tell({"next": {"take": take, "index": 4}})),
        *((four, answer) for answer in ((502, {"retry-after": "1"}, b""), (404, {}, b""))),
        ("", tell({"newest": {"take": take, "index": 6}, "to_ms": ENDS_MS + 60_000})),
        (six, (200, BYTES, (SEGMENTS / "no_frames.pcs").read_bytes())),
        (seven, (204, {"retry-ms": "60000"}, b"")),
    ]
    wanted, answers = [path for path, _ in script], iter(script)
    asked: list[tuple[float, str]] = []

    class Relay(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            path = self.path.removeprefix("/api/v1/robots/demo/past")
            asked.append((time.monotonic(), path))
            _, (status, headers, body) = next(answers)
            if status == HANG_UP[0]:
                self.close_connection = True
                return
            self.send_response(status)
            for name, value in headers.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)

    with ThreadingHTTPServer(("127.0.0.1", 0), Relay) as server:
        threading.Thread(target=server.serve_forever).start()
        program = tmp_path / "past.py"
        address = f"127.0.0.1:{server.server_port}"
        program.write_text(block("python", "# past.py").replace(ADDRESS, address))
        part = stack.start("past", sys.executable, str(program))
        try:
            until("all is asked", lambda: len(asked) >= len(wanted) or part.process.poll() is not None)
        finally:
            server.shutdown()
    assert part.process.poll() is None, part.log
    assert [path for _, path in asked] == wanted
    for again in ("", f"/public/{take}/0"):
        first_s, second_s, *_ = (at_s for at_s, path in asked if path == again)
        assert second_s - first_s >= 0.3


def tell(document: Any) -> Answer:
    """A document as an answer."""
    return 200, {"content-type": "application/json"}, json.dumps(document).encode()


def listed(demo: str, past: str) -> list[dict[str, Any]]:
    """The segments of the past, by the ten minutes in which each starts."""
    summary = get(demo, past)
    segments = []
    for ten_minutes in range(summary["from_ms"] // 600_000, summary["to_ms"] // 600_000 + 1):
        begin = datetime.fromtimestamp(ten_minutes * 600, UTC).strftime("%Y-%m-%dT%H:%MZ")
        page = get(demo, f"{past}/public/{begin}")
        assert page.keys() == sample('"first_seq"').keys()
        segments += page["segments"]
    return segments


def test_javascript(demo: str, stack: Any, tmp_path: Path) -> None:
    program = tmp_path / "watch.mjs"
    program.write_text(block("js", "// watch.mjs").replace(ADDRESS, demo))
    version = subprocess.run(["node", "--version"], capture_output=True, check=True, text=True).stdout
    major = int(version.lstrip("v").split(".")[0])
    flags = ["--experimental-websocket"] if major < 22 else []
    lines = first_lines(stack, "node", "node", *flags, str(program))
    assert len(set(lines)) == LINES
    assert "WST" in json.loads(lines[0])


def test_the_answers_have_the_members_shown(demo: str) -> None:
    assert sample('{"robots"')["robots"][0].keys() == get(demo, "/api/v1/robots")["robots"][0].keys()
    shown, real = sample('"fields"'), get(demo, "/api/v1/robots/demo/state")
    assert shown.keys() == real.keys()
    for field, part in shown["fields"].items():
        assert part["unit"] == real["fields"][field]["unit"]
        assert part["values"].keys() <= real["fields"][field]["values"].keys()
    added = re.search(r"`GET /api/v1/robots/\{robot\}` adds (.*?)\n\n", PAGE, re.DOTALL)
    assert added is not None
    one, listed = get(demo, "/api/v1/robots/demo"), get(demo, "/api/v1/robots")["robots"][0]
    assert set(re.findall(r"`([a-z_]+)`", added[1])) == one.keys() - listed.keys()


def test_the_admins_routes_are_those_there_are_and_answer_what_is_shown(stack: Any, tmp_path: Path) -> None:
    file = tmp_path / "robots.toml"

    def robots(*words: str) -> str:
        command = [f"{BIN}/posecast-relay", "robots", *words, "--robots", str(file)]
        return str(
            subprocess.run(command, check=True, capture_output=True, text=True, timeout=20).stdout
        ).strip()

    credential = robots("add", "hubo", "--days", "30")
    robots("set", "hubo", "--link", "view=public")
    kept = tmp_path / "credential"
    kept.touch(0o600)
    kept.write_text(credential)
    secret = robots("admin")
    flags = ("--robots", str(file), "--past", f"file://{tmp_path}/past")
    part = stack.start(
        *("relay", *stack.relay_command, "run", "--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0", *flags)
    )
    address, zenoh = part.line(r"serving http://(\S+), robots on (tcp/\S+)").groups()
    agent = ("run", "--robot", "hubo", "--source", "demo", "--relay", zenoh)
    stack.start("edge", *stack.edge_command, *agent, "--credential", str(kept))

    def ask(method: str, path: str, token: str = secret) -> tuple[int, Any]:
        headers = {"authorization": f"Bearer {token}"}
        request = urllib.request.Request(f"http://{address}{path}", method=method, headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=10) as answer:
                return answer.status, json.load(answer)
        except urllib.error.HTTPError as refusal:
            return refusal.code, json.load(refusal)

    def report() -> Any:
        return ask("GET", "/api/v1/admin")[1]

    until("it is on air", lambda: report()["robots"][0]["status"] == "online")
    shown, real = sample('"delivered_frames"'), report()
    assert shown.keys() == real.keys()
    for part_name in ("relay", "past", "archive"):
        assert shown[part_name].keys() == real[part_name].keys(), part_name
    assert shown["robots"][0].keys() == real["robots"][0].keys()
    rows = re.findall(r"^\| `(GET|POST|DELETE) (/api/v1/admin\S*)` \| ", PAGE, re.MULTILINE)
    document = ask("GET", "/openapi.json")[1]["paths"]
    there = {(method.upper(), path) for path in document if "/admin" in path for method in document[path]}
    assert {(method, path.partition("?")[0]) for method, path in rows} == there
    statuses = {*re.findall(r"^\| (\d{3}) \| ", section("The admin's page"), re.MULTILINE)}
    assert statuses == {
        status
        for method, path in there
        for status in document[path][method.lower()]["responses"]
        if status.startswith(("4", "5"))
    }
    for method, path in rows:
        of_hubo = path.replace("{robot}", "hubo")
        assert ask(method, of_hubo, "x")[0] == 401
        status, told = ask(method, of_hubo)
        assert status == 200
        assert method != "POST" or told.keys() == {"link", "until_s"}


def section(heading: str) -> str:
    """The text below a heading of the page, up to the next one of its kind."""
    return PAGE.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
