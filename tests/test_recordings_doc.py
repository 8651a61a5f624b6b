"""docs/how-to/record and docs/reference/past-export.md, followed step by step: a demo's past is archived,
exported with their commands from the archive and from a running relay, and served with their nginx
configuration."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import urllib.error
import urllib.request
from email.message import Message
from pathlib import Path
from typing import Any

import pytest
from posecast_relay.recording.notes import read_notes
from posecast_testing import free_port, until
from posecast_wire.recording import decode_recording

from tests.conftest import BIN

ROOT = Path(__file__).resolve().parent.parent
PAGES = {
    name: (ROOT / f"docs/{name}.md").read_text()
    for name in (
        *(f"how-to/record/{page}" for page in ("keep-a-lecture", "host-a-recording", "csv", "mcap")),
        "how-to/record/save-from-the-page",
        "how-to/watch/play-a-recording",
        "reference/past-export",
    )
}
LECTURE, HOST = PAGES["how-to/record/keep-a-lecture"], PAGES["how-to/record/host-a-recording"]
ADD = re.compile(r"^\(umask 077; (posecast-relay robots add .*) > \S+\)$", re.MULTILINE)
KEEP = re.compile(r"^ *(posecast-relay robots set .*)$", re.MULTILINE)
EXPORT = re.compile(r"^(?:runuser .* /opt/posecast/bin/)?(posecast-relay past export .*)$", re.MULTILINE)
CONVERT = re.compile(r"^(posecast convert .*)$", re.MULTILINE)
ARCHIVE = "file:///srv/posecast/past"
SPAN = {"--from": "2026-01-01", "--to": "2099-01-01"}  # instead of a lecture's
BEYOND = r"posecast-relay: \S+: there is nothing before \S+, nothing after \S+\n"

pytestmark = pytest.mark.skipif(not (ROOT / "spa/dist/index.html").exists(), reason="no built page")


def blocks(page: str, language: str) -> list[str]:
    """The blocks of a language, without the indentation of lists."""
    found = re.findall(rf"^( *)```{language}\n(.*?)^ *```", page, re.DOTALL | re.MULTILINE)
    return [re.sub(rf"^{indent}", "", text, flags=re.MULTILINE) for indent, text in found]


def commands(pattern: re.Pattern[str], *pages: str) -> list[str]:
    """The commands of a kind in the blocks of pages, each as one line."""
    text = "\n".join(block for page in pages for block in blocks(page, "sh"))
    return pattern.findall(re.sub(r" *\\\n *", " ", text))


def get(address: str, **headers: str) -> tuple[Message, bytes]:
    """Headers and body."""
    request = urllib.request.Request(address, headers={k.replace("_", "-"): v for k, v in headers.items()})
    with urllib.request.urlopen(request, timeout=10) as answer:
        return answer.headers, answer.read()


def carry_out(command: str, folder: Path, at: Path, *more: str) -> subprocess.CompletedProcess[str]:
    """Run a command of a page in `at`, with the archive in `folder`."""
    command = command.replace(ARCHIVE, f"file://{folder}/past").replace("/srv/exports/", "")
    _, *arguments = shlex.split(command)
    for flag, value in SPAN.items():
        if flag in arguments:
            arguments[arguments.index(flag) + 1] = value
    done = subprocess.run(
        [f"{BIN}/posecast-relay", *arguments, *more],
        cwd=at,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, (command, done.stderr)
    return done


def export_all(folder: Path, relay: str) -> dict[str, Path]:
    """Run each export on the pages, each in its own folder, or where it replaces the previous one. Return the
    commands and their output locations.
    """
    found: dict[str, Path] = {}
    at = folder
    for command in commands(EXPORT, *PAGES.values()):
        if "--replace" not in command:
            at = folder / str(len(found))
            at.mkdir()
            shutil.copy(folder / "notes.toml", at)
        done = carry_out(command, folder, at, *(() if "--past" in command else ("--relay", relay)))
        assert re.fullmatch(BEYOND, done.stderr), (command, done.stderr)
        found[command] = at / done.stdout.split(":")[0]
    return found


def test_what_the_pages_say_is_so(stack: Any, tmp_path: Path) -> None:
    (notes,) = blocks(LECTURE, "toml")
    (tmp_path / "notes.toml").write_text(notes)
    texts = [note.text for note in read_notes(tmp_path / "notes.toml")]
    assert [text.split("\n")[0] for text in texts] == ["It takes the first step.", "The left knee warms up."]
    (tmp_path / "notes.toml").write_text(re.sub(r"(?m)^at = [^#\n]*", 'at = "00:01" ', notes))

    (add,) = commands(ADD, LECTURE)
    carry_out(add, tmp_path, tmp_path)
    keep, remember = commands(KEEP, LECTURE)
    carry_out(remember, tmp_path, tmp_path)
    carry_out(keep, tmp_path, tmp_path)
    _, address, zenoh = stack.relay(
        flags=("--robots", f"{tmp_path}/robots.toml", "--past", f"file://{tmp_path}/past")
    )
    stack.start(
        "edge", f"{BIN}/posecast-edge", "run", "--robot", "hubo", "--relay", zenoh, "--source", "demo"
    )

    def has_past() -> bool:
        try:
            newest = json.loads(get(f"http://{address}/api/v1/robots/hubo/past")[1])["newest"]
        except urllib.error.URLError:
            return False
        kept = ("*.segment", "models/*/manifest.json")
        return newest is not None and all(any((tmp_path / "past").rglob(name)) for name in kept)

    until("the demo has a past and a model, also in the archive", has_past, 60)
    listings = re.findall(r"posecast-relay past list [^`\n]+", LECTURE)
    assert len(listings) == 2
    for command in listings:
        assert re.search(r"^hubo +public ", carry_out(command, tmp_path, tmp_path).stdout, re.MULTILINE)
    found = export_all(tmp_path, f"http://{address}")
    written = ["lecture"] * 4 + ["walk.posecast", "walk.csv", "walk.mcap"]  # one of them is on two pages
    assert [place.name for place in found.values()] == written
    assert sum(ARCHIVE in command for command in found) == 2
    (lecture,) = (place for command, place in found.items() if "--title" in command)
    recording = decode_recording((lecture / "recording.json").read_bytes())
    assert (recording.title, recording.licence) == ("Walking, lecture 7", "CC BY 4.0")
    assert [note.text for note in recording.notes] == texts
    assert '"https://uni.example/robots/lecture-7/models/' in (lecture / "index.html").read_text()
    (packed,) = (place for place in found.values() if place.suffix == ".posecast")
    check_conversions(packed, lecture)
    check_python_server(stack, lecture)
    if shutil.which("nginx") is not None:
        check_nginx(stack, lecture.parent, recording.models[0])


def check_conversions(packed: Path, lecture: Path) -> None:
    """The commands that convert a saved file, and the one that makes a folder's data later."""
    found = commands(CONVERT, *PAGES.values())
    found += re.findall(r"`(posecast convert lecture/ \S+)`", PAGES["reference/past-export"])
    assert len(found) == 3
    for command in found:
        source, out = shlex.split(command)[2:]
        at = packed if source.endswith(".posecast") else lecture
        done = subprocess.run(
            [f"{BIN}/posecast", "convert", str(at), out],
            cwd=packed.parent,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, ""), command
        assert done.stdout.startswith(f"{out}: hubo/public, "), command
        (packed.parent / out).unlink()
    for name in ("data.csv", "data.mcap"):
        assert (lecture / name).stat().st_size > 10_000


def check_python_server(stack: Any, lecture: Path) -> None:
    """The one command that three pages give serves the folder."""
    found = {
        line
        for page in PAGES.values()
        for line in re.findall(r"^ *(python3 -m http\.server .*)$", page, re.MULTILINE)
    }
    (command,) = found
    port = free_port()
    words = ["python3", *shlex.split(command)[1:-1], str(port), "--bind", "127.0.0.1"]
    words[words.index("lecture")] = str(lecture)
    stack.start("http.server", *words)

    def answers() -> bool:
        try:
            return (
                get(f"http://127.0.0.1:{port}/recording.json")[1] == (lecture / "recording.json").read_bytes()
            )
        except urllib.error.URLError:
            return False

    until("it serves the recording", answers)
    assert b"<script" in get(f"http://127.0.0.1:{port}/")[1]


def check_nginx(stack: Any, folder: Path, model: str) -> None:
    """The page's nginx serves the folder below a path, with the headers promised in its table."""
    port = free_port()
    (server,) = blocks(HOST, "nginx")
    server = server.replace("listen 80", f"listen 127.0.0.1:{port}")
    server = server.replace("/srv/recordings", str(folder))
    places = "".join(
        f"{kind}_temp_path {folder}/{kind};" for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    (folder / "nginx.conf").write_text(
        f"pid {folder}/pid; daemon off; master_process off; error_log {folder}/errors; events {{}}"
        f"http {{ include /etc/nginx/mime.types; access_log off; {places} {server} }}"
    )
    stack.start("nginx", "nginx", "-p", str(folder), "-c", str(folder / "nginx.conf"))
    at = f"http://127.0.0.1:{port}/lecture/"

    def answers() -> bool:
        try:
            return bool(get(at))
        except OSError:
            return False

    until("nginx answers", answers)
    lecture = folder / "lecture"
    segment = next((lecture / "segments").rglob("*.segment")).relative_to(lecture)
    key_page = next((lecture / "keys").iterdir()).relative_to(lecture)
    script = next((lecture / "assets").glob("index-*.js")).relative_to(lecture)
    for path in (script, segment, f"models/{model}/manifest.json"):
        assert get(f"{at}{path}")[0]["cache-control"] == "public, max-age=31536000, immutable", path
    for path in ("", "embed/", "recording.json", key_page):
        assert get(f"{at}{path}")[0]["cache-control"] == "no-cache", path
    for path in (script, "recording.json"):  # segments are gzip already
        headers, body = get(f"{at}{path}", accept_encoding="gzip")
        assert headers["content-encoding"] == "gzip", path
        assert len(body) < (lecture / path).stat().st_size
