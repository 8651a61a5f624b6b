"""`posecast-relay past export` of a running relay: the command as somebody types it, with a robot on air."""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
import urllib.request
import zipfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest
from posecast_relay.config.settings import SettingsError
from posecast_relay.core.policy import make_link
from posecast_relay.past_command.main import run_past
from posecast_relay.recording import http_source
from posecast_testing import free_port, until
from posecast_wire.recording import decode_recording, segment_path

from .command import run_command
from .recording_stage import list_files, make_page
from .stage import Model, Relay, ZenohEdge
from .test_past_relay import await_segment, write
from .test_recording_page import PNG, tags

KEY = "k" * 43
SPAN = ("--from", "2026-01-01T00:00Z", "--to", "2099-01-01")


EXPORT = ("past", "export", "--robot", "r", *SPAN)
COMMAND = (sys.executable, "-m", "posecast_relay.cli", *EXPORT)


def export(*arguments: str) -> subprocess.CompletedProcess[str]:
    """The command's outcome."""
    return run_command(*EXPORT, *arguments)


def refusal(result: subprocess.CompletedProcess[str], status: int = 1) -> str:
    """The one line of an outcome."""
    assert result.returncode == status, (result.stdout, result.stderr)
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith("posecast-relay: ")
    return result.stderr.removeprefix("posecast-relay: ").rstrip("\n")


def run_refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    """Status and line of a command in this process, without the time that one takes to start."""
    try:
        run_past(["export", "--robot", "r", *SPAN, *arguments], {})
    except SettingsError as e:
        return 2, str(e)
    except SystemExit as e:
        said = capsys.readouterr()
        assert said.out == ""
        return int(str(e.code)), said.err.removeprefix("posecast-relay: ").removesuffix("\n")
    raise AssertionError(f"nothing was wrong: {arguments}")


def list_names(folder: Path) -> list[str]:
    """What lies there, but for what the relay says."""
    return sorted(name for name in os.listdir(folder) if not name.startswith("relay-"))


def get(address: str) -> bytes:
    with urllib.request.urlopen(address, timeout=10) as answer:
        data: bytes = answer.read()
        return data


def serve(folder: Path, root: Path, place: str) -> tuple[subprocess.Popen[bytes], str]:
    """A plain nginx over a folder, below `place`; its address."""
    port = free_port()
    places = "".join(
        f"{kind}_temp_path {folder}/{kind};" for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    (folder / "nginx.conf").write_text(
        f"pid {folder}/pid; daemon off; master_process off; error_log {folder}/errors; events {{}}"
        f"http {{ include /etc/nginx/mime.types; access_log off; {places}"
        f"server {{ listen 127.0.0.1:{port}; location {place} {{ alias {root}/; }} }} }}"
    )
    nginx = subprocess.Popen(["nginx", "-p", str(folder), "-c", str(folder / "nginx.conf")])
    address = f"http://127.0.0.1:{port}{place}"

    def answers() -> bool:
        try:
            return bool(get(f"{address}recording.json"))
        except OSError:
            return False

    until("nginx answers", answers)
    return nginx, address


class Station(NamedTuple):
    """A relay with a robot on air that has a past."""

    relay: Relay
    edge: ZenohEdge
    model: Model


@pytest.fixture(scope="module")
def station(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    """One for all tests: each takes seconds to have a past."""
    files = {"high.glb": (os.urandom(300_000), "model/gltf-binary"), "small.png": (PNG, "image/png")}
    model = Model(files, thumbnail="small.png")
    relay = Relay(tmp_path_factory.mktemp("station"), "--past", "memory:")
    edge = ZenohEdge(relay.zenoh, model=model)
    try:
        edge.event("a fault")
        await_segment(relay, edge, 3)
        yield Station(relay, edge, model)
    finally:
        edge.close()
        relay.stop()


def test_a_folder_and_a_file_hold_what_the_relay_has(tmp_path: Path, station: Station) -> None:
    relay, _, model = station
    (tmp_path / "notes.toml").write_text('[[note]]\nat = "0:01"\ntext = "It moves."\n')
    arguments = ["--relay", f"http://{relay.address}", "--notes", str(tmp_path / "notes.toml")]
    page = ["--page", str(make_page(tmp_path / "page")), "--url", "https://uni.example/7"]
    beyond = r"posecast-relay: \S+: there is nothing before \S+, nothing after \S+\n"  # of SPAN
    done = export("-o", str(tmp_path / "lecture"), "--title", "Walking", *arguments, *page)
    assert done.returncode == 0
    no_tree = (
        r"posecast-relay: \S+: data\.mcap: no /tf of the model \w+: v: a URDF that has not been built;.+\n"
    )
    assert re.fullmatch(no_tree + beyond, done.stderr)
    assert done.stdout.startswith(f"{tmp_path}/lecture: r/public, 0:00:")
    done = export("-o", str(tmp_path / "x.posecast"), *arguments)
    assert done.returncode == 0
    assert re.fullmatch(beyond, done.stderr)

    recording = decode_recording((tmp_path / "lecture/recording.json").read_bytes())
    assert (recording.robot, recording.view, recording.title) == ("r", "public", "Walking")
    assert [note.text for note in recording.notes] == ["It moves."]
    assert recording.models == (model.digest,)
    assert [event.event["text"] for each in recording.segments for event in each.events] == ["a fault"]
    assert {each.index for each in recording.segments} >= {0, 1, 2, 3}
    past = f"http://{relay.address}/api/v1/robots/r/past/public"
    for each in recording.segments:
        file = tmp_path / "lecture" / segment_path(each.take, each.index)
        assert file.read_bytes() == get(f"{past}/{each.take:016x}/{each.index}")
    folder = tmp_path / "lecture/models" / model.digest
    assert (folder / "manifest.json").read_bytes() == model.manifest
    assert (folder / "small.png").read_bytes() == PNG
    html = (tmp_path / "lecture/index.html").read_text()
    assert tags(html)["og:image"] == f"https://uni.example/7/models/{model.digest}/small.png"

    with zipfile.ZipFile(tmp_path / "x.posecast") as packed:
        assert packed.testzip() is None
        for each in recording.segments:
            name = segment_path(each.take, each.index)
            assert packed.read(name) == (tmp_path / "lecture" / name).read_bytes()
    done = export("-o", str(tmp_path / "x.csv"), *arguments[:2])
    assert done.returncode == 0
    assert (tmp_path / "x.csv").read_bytes().startswith("\ufefftime,".encode())
    assert list_names(tmp_path) == ["lecture", "notes.toml", "page", "x.csv", "x.posecast"]


@pytest.mark.skipif(shutil.which("nginx") is None, reason="no nginx here: apt-get install nginx")
@pytest.mark.parametrize("place", ["/", "/uni/robots/7/"])
def test_a_plain_nginx_serves_it(tmp_path: Path, station: Station, place: str) -> None:
    relay = station.relay
    page = make_page(tmp_path / "page")
    lecture = tmp_path / "lecture"
    done = export("-o", str(lecture), "--relay", f"http://{relay.address}", "--page", str(page))
    assert done.returncode == 0, done.stderr
    (tmp_path / "nginx").mkdir()
    nginx, address = serve(tmp_path / "nginx", lecture, place)
    try:
        for path in list_files(lecture):
            assert get(address + path) == (lecture / path).read_bytes()
        assert get(address) == (lecture / "index.html").read_bytes()
        assert get(f"{address}embed/") == (lecture / "embed/index.html").read_bytes()
    finally:
        nginx.terminate()
        nginx.wait()


def test_what_may_be_exported_is_listed(station: Station, capsys: pytest.CaptureFixture[str]) -> None:
    at = f"http://{station.relay.address}"
    for arguments in ([], ["--robot", "r"], ["--robot", "r", "--view", "public", "--days"]):
        run_past(["list", "--relay", at, *arguments], {})
        head, *rows = capsys.readouterr().out.splitlines()
        days = ["day"] if "--days" in arguments else []
        assert head.split() == ["robot", "view", *days, "from", "to", "segments"]
        assert [row.split()[:2] for row in rows] == [["r", "public"]]
        assert int(rows[0].split()[-1]) >= 3
    for wrong, told in (("http://127.0.0.1:1", "is it another address? --relay URL"), (at, "no such robot")):
        with pytest.raises(SystemExit, match="1"):
            run_past(["list", "--relay", wrong, "--robot", "nobody"], {})
        assert told in capsys.readouterr().err


def test_what_is_private_needs_a_token_and_a_word(
    tmp_path: Path,
    relays: Callable[..., Relay],
    edges: Callable[..., ZenohEdge],
    capsys: pytest.CaptureFixture[str],
) -> None:
    write(
        tmp_path / "robots.toml",
        f"[robots.r]\nlink_key = '{KEY}'\n[robots.r.link]\nview = 'lab'\npast = '30m'\n",
    )
    relay = relays("--past", "memory:", "--robots", str(tmp_path / "robots.toml"))
    edge = edges(relay.zenoh, view="lab")
    token = make_link(KEY, "r", int(time.time()) + 1000, "abcdefgh")
    (tmp_path / "token").write_text(f"{token}\n")
    request = urllib.request.Request(
        f"http://{relay.address}/api/v1/robots/r/past", headers={"authorization": f"Bearer {token}"}
    )

    def recorded() -> bool:
        edge.force_key = True
        try:
            with urllib.request.urlopen(request, timeout=5) as answer:
                return json.load(answer)["newest"] is not None
        except OSError:
            return False

    until("a segment", recorded, 15.0)
    out = ["-o", str(tmp_path / "x.posecast"), "--relay", f"http://{relay.address}"]
    refused = partial(run_refused, capsys, *out)
    assert "/api/v1/robots/r/past: " in refused()[1]
    assert refused("--as", "link") == (
        2,
        "--as link: the relay needs the token of such a viewer: give --token-file FILE",
    )
    with_token = ["--token-file", str(tmp_path / "token")]
    for audience in ([], ["--as", "anyone"]):
        status, said = refused(*with_token, *audience)
        assert (status, "confirm it with --as signed-in or --as link" in said) == (2, True)
    (tmp_path / "wrong").write_text(token[:-1])
    status, said = refused("--token-file", str(tmp_path / "wrong"), "--as", "link")
    assert (status, token[:20] in said) == (1, False)
    (tmp_path / "wrong").write_text("two words")
    assert "contains no token" in refused("--token-file", str(tmp_path / "wrong"), "--as", "link")[1]
    assert not (tmp_path / "x.posecast").exists()
    done = export(*out, *with_token, "--as", "link")
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(tmp_path / "x.posecast") as packed:
        assert decode_recording(packed.read("recording.json")).view == "lab"
        assert all(token.encode() not in packed.read(name) for name in packed.namelist())


def test_one_line_for_all_that_is_wrong(
    tmp_path: Path, station: Station, capsys: pytest.CaptureFixture[str]
) -> None:
    refused = partial(run_refused, capsys)
    out = ["-o", str(tmp_path / "x.posecast"), "--relay", f"http://{station.relay.address}"]
    at = f"{out[-1]}/api/v1/robots/nobody/past"
    assert refused(*out, "--robot", "nobody") == (1, f"{at}: no such robot, or you may not see it")
    status, said = refused(*out, "--from", "2026-01-01T00:00+01:00", "--to", "2026-01-01T01:00+01:00")
    assert status == 1
    assert re.fullmatch(
        r"r/public, from \S+ to \S+: nothing was recorded in this span; it has a recording from \S+ to \S+",
        said,
    )
    wrong: list[tuple[list[str], int, str]] = [
        (["--view", "lab"], 1, "/past?view=lab: "),
        (["--robot", "R"], 2, "argument --robot: name 'R': use 1 to 63 of a-z"),
        (["--from", "yesterday"], 2, "argument --from: 'yesterday': use 2026-11-22T14:20"),
        (["--to", "2026-02-30"], 2, "argument --to: '2026-02-30': "),
        (["--from", "25:00"], 2, "argument --from: '25:00': use"),
        (["--from", "2026-01-02", "--to", "2026-01-01"], 2, "--from is not before --to"),
        (["--title", "a\nb"], 2, "argument --title: use 1 to 500 characters in one line"),
        (["--relay", "127.0.0.1"], 1, "127.0.0.1: not the address of a relay: use http://HOST:PORT"),
        (
            ["--relay", f"http://127.0.0.1:{free_port()}"],
            1,
            "/past: connection refused; is it another address? --relay URL",
        ),
        (
            ["-o", str(tmp_path / "x.mp4")],
            2,
            "argument -o/--out: use .posecast, .csv, .mcap, or the name of a f",
        ),
        (["--notes", "none.toml"], 2, "--notes none.toml: no such file or directory"),
        (["--page", str(tmp_path)], 2, "--page: only works for a folder; a .posecast file has no page"),
        (
            ["-o", str(tmp_path / "lecture"), "--page", str(tmp_path)],
            1,
            "not a built page: index.html is not",
        ),
        (["-o", str(tmp_path / "x.csv"), "--notes", os.devnull], 2, "--notes: a .csv file can't hold notes"),
        (["-o", "/no/where"], 1, "/no/where: there is no folder /no"),
        (["-o", ".."], 2, "argument -o/--out: name a new folder or file"),
        (["--as", "everybody"], 2, "argument --as: invalid choice: 'everybody'"),
        (["--past", "file:///tmp"], 2, "give --relay or --past, not both"),
    ]
    for arguments, expected, says in wrong:
        status, said = refused(*out, *arguments)
        assert (status, says in said, "\n" in said) == (expected, True, False), (arguments, said)
    assert list_names(tmp_path) == []


def test_a_robot_that_is_off_costs_its_model_and_not_its_past(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A relay without an archive gets a model's files from the robot."""
    monkeypatch.setattr(http_source, "AGAIN_S", 1e6)  # nothing is waited for
    files = {"high.glb": (os.urandom(3000), "model/gltf-binary"), "small.png": (PNG, "image/png")}
    relay = Relay(tmp_path, "--past", "memory:")
    edge = ZenohEdge(relay.zenoh, model=Model(files))
    try:
        await_segment(relay, edge, 1)
        edge.close()
        until("it is off", lambda: b'"offline"' in get(f"http://{relay.address}/api/v1/robots/r"))
        for name in ("x.posecast", "x.csv"):
            to = tmp_path / name
            run_past(
                ["export", "--robot", "r", *SPAN, "--relay", f"http://{relay.address}", "-o", str(to)], {}
            )
            said = capsys.readouterr().err
            assert re.search(r": models/\w+/manifest\.json: http\S+: the robot", said), name
            assert to.stat().st_size > 0
    finally:
        edge.close()
        relay.stop()


def test_a_disk_that_fills_up_leaves_nothing(tmp_path: Path, station: Station) -> None:
    page = make_page(tmp_path / "page")
    for name in ("lecture", "x.posecast"):
        arguments = ["-o", str(tmp_path / name), "--relay", f"http://{station.relay.address}"]
        arguments += ["--page", str(page)] if name == "lecture" else []
        limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))  # noqa: E731
        done = subprocess.run(
            [*COMMAND, *arguments], capture_output=True, text=True, timeout=60, check=False, preexec_fn=limit
        )
        said = refusal(done)
        assert said == f"{tmp_path}/{name}: file too large; nothing of it is left"
    assert list_names(tmp_path) == ["page"]


def test_an_end_in_the_middle_leaves_the_earlier_one(tmp_path: Path, station: Station) -> None:
    lecture, relay = tmp_path / "lecture", station.relay
    page = make_page(tmp_path / "page")
    arguments = ["-o", str(lecture), "--page", str(page), "--replace", "--relay", f"http://{relay.address}"]
    assert export(*arguments).returncode == 0
    before = {path: (lecture / path).read_bytes() for path in list_files(lecture)}
    for how in (signal.SIGTERM, signal.SIGINT, signal.SIGKILL):
        relay.process.send_signal(signal.SIGSTOP)  # it answers no more
        with subprocess.Popen([*COMMAND, *arguments], stderr=subprocess.PIPE, text=True) as writer:
            try:
                until("it has begun", (tmp_path / ".lecture.posecast-part/made").is_dir)
                writer.send_signal(how)
                _, said = writer.communicate(timeout=30)
            finally:
                writer.kill()
                relay.process.send_signal(signal.SIGCONT)
        assert {path: (lecture / path).read_bytes() for path in list_files(lecture)} == before
        if how == signal.SIGKILL:
            assert writer.returncode == -9
            continue
        assert (writer.returncode, said) == (
            1,
            f"posecast-relay: {lecture}: interrupted; no files were left behind\n",
        )
        assert list_names(tmp_path) == ["lecture", "page"]
    assert export(*arguments).returncode == 0
    assert list_names(tmp_path) == ["lecture", "page"]
