"""docs/how-to/record/recordings.md, done as it says: a demo's past is exported by its commands and served by
its nginx."""

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
from posecast_wire.recording import decode_recording

from tests.conftest import BIN, free_port, until

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs/how-to/record/recordings.md").read_text()
COMMANDS = re.findall(r"^    (posecast-relay past export .*)$", PAGE, re.MULTILINE)
SPAN = {"--from": "2026-01-01", "--to": "2099-01-01"}  # instead of a lecture's
BEYOND = r"posecast-relay: \S+: there is nothing before \S+, nothing after \S+\n"

pytestmark = pytest.mark.skipif(not (ROOT / "spa/dist/index.html").exists(), reason="no built page")


def block(language: str) -> str:
    """The one block of a language."""
    (found,) = re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
    return str(found)


def get(address: str, **headers: str) -> tuple[Message, bytes]:
    """Headers and body."""
    request = urllib.request.Request(address, headers={k.replace("_", "-"): v for k, v in headers.items()})
    with urllib.request.urlopen(request, timeout=10) as answer:
        return answer.headers, answer.read()


def export_all(folder: Path, relay: str) -> None:
    """Carry out each command of the page."""
    for command in COMMANDS:
        _, *arguments = shlex.split(command)
        for flag, value in SPAN.items():
            arguments[arguments.index(flag) + 1] = value
        done = subprocess.run(
            [f"{BIN}/posecast-relay", *arguments, "--relay", relay],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == 0, (command, done.stderr)
        assert re.fullmatch(BEYOND, done.stderr), (command, done.stderr)


def test_what_the_page_says_is_so(stack: Any, tmp_path: Path) -> None:
    (tmp_path / "notes.toml").write_text(block("toml"))
    texts = [note.text for note in read_notes(tmp_path / "notes.toml")]
    assert [text.split("\n")[0] for text in texts] == ["It takes the first step.", "The left knee warms up."]
    (tmp_path / "notes.toml").write_text(re.sub(r"(?m)^at = [^#\n]*", 'at = "00:01" ', block("toml")))

    _, address, zenoh = stack.relay()
    stack.edge(zenoh, "--source", "demo")

    def has_past() -> bool:
        try:
            doc = json.loads(get(f"http://{address}/api/v1/robots/demo/past")[1])
        except urllib.error.URLError:
            return False
        return doc["newest"] is not None and bool(
            json.loads(get(f"http://{address}/api/v1/robots/demo")[1])["model"]
        )

    until("the demo has a past and a model", has_past, 40)
    export_all(tmp_path, f"http://{address}")
    assert len(COMMANDS) == 5
    recording = decode_recording((tmp_path / "lecture/recording.json").read_bytes())
    assert (recording.title, recording.licence) == ("Walking, lecture 7", "CC BY 4.0")
    assert [note.text for note in recording.notes] == texts
    assert '"https://uni.example/robots/lecture-7/models/' in (tmp_path / "lecture/index.html").read_text()
    if shutil.which("nginx") is not None:
        check_nginx(stack, tmp_path, recording.models[0])


def check_nginx(stack: Any, folder: Path, model: str) -> None:
    """The page's nginx serves the folder below a path, with the headers that its table promises."""
    port = free_port()
    server = block("nginx").replace("listen 80", f"listen 127.0.0.1:{port}")
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
