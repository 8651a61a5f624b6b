"""The guide at /guide/: its files, what they may load, what is not there."""

from __future__ import annotations

import gzip
import socket
from pathlib import Path

import httpx
import pytest

from .stage import SharedRelay

SELF = "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action 'none'"
FRAMES = "frame-ancestors 'self'"
SCRIPT = "assets/javascripts/bundle.77dd0ce9.min.js"


@pytest.fixture
def page(relay: SharedRelay) -> Path:
    (relay.page / "index.html").write_text("<!doctype html><html lang='en'><head></head><title>page</title>")
    return relay.page


@pytest.fixture
def guide(page: Path) -> Path:
    folder = page / "guide"
    (folder / "how-to").mkdir(parents=True)
    (folder / SCRIPT).parent.mkdir(parents=True)
    (folder / "index.html").write_text("<title>guide</title>")
    (folder / "how-to/share.html").write_text("<title>share</title>")
    (folder / "404.html").write_text('<html lang="en"><head></head><a href="./index.html">search</a>')
    (folder / SCRIPT).write_text("1")
    (folder / "search.js").write_text("var __index = 1;" * 100)
    (folder / "search.js.gz").write_bytes(gzip.compress(b"var __index = 1;" * 100))
    return folder


def ask_raw(address: str, target: str) -> bytes:
    """The answer to a request line as it is: a client would tidy up the path."""
    host, _, port = address.rpartition(":")
    with socket.create_connection((host, int(port)), timeout=10) as link:
        link.sendall(f"GET {target} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n".encode())
        answer = b""
        while part := link.recv(65536):
            answer += part
    return answer


def test_pages_come_with_a_policy_and_are_asked_for_each_time(
    relay: SharedRelay, page: Path, guide: Path
) -> None:
    base = f"{relay.base}/guide/"
    for path, title in (("", "guide"), ("index.html", "guide"), ("how-to/share.html", "share")):
        answer = httpx.get(base + path)
        assert answer.status_code == 200
        assert title in answer.text
        assert answer.headers["content-security-policy"] == f"{SELF}; {FRAMES}"
        assert answer.headers["x-frame-options"] == "SAMEORIGIN"
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert answer.headers["cross-origin-opener-policy"] == "same-origin"
        assert answer.headers["cache-control"] == "no-cache"
        again = httpx.get(base + path, headers={"if-none-match": answer.headers["etag"]})
        assert again.status_code == 304
        assert again.content == b""
    assert httpx.head(base).status_code == 200
    assert httpx.post(base).status_code == 405
    moved = httpx.get(base.rstrip("/"))
    assert moved.status_code == 307
    assert moved.headers["location"].endswith("/guide/")


def test_a_file_with_a_hash_in_its_name_is_asked_for_once(
    relay: SharedRelay, page: Path, guide: Path
) -> None:
    base = f"{relay.base}/guide/"
    hashed, plain = httpx.get(base + SCRIPT), httpx.get(base + "search.js")
    assert hashed.headers["cache-control"] == "public, max-age=31536000, immutable"
    assert plain.headers["cache-control"] == "no-cache"
    assert plain.headers["content-encoding"] == "gzip"
    assert plain.text.startswith("var __index")
    # the search runs in a worker, which its own headers bind
    assert hashed.headers["content-security-policy"] == plain.headers["content-security-policy"]
    assert hashed.headers["content-security-policy"].startswith("default-src 'self'")


def test_what_is_not_there_is_one_page_with_a_way_back(relay: SharedRelay, page: Path, guide: Path) -> None:
    base = f"{relay.base}/guide/"
    for path, home in (("gone.html", "../guide/"), ("how-to/no/such", "../../../guide/")):
        answer = httpx.get(base + path)
        assert answer.status_code == 404
        assert f'<a href="{home}index.html">' in answer.text
        assert answer.headers["content-security-policy"] == f"{SELF}; {FRAMES}"
        assert answer.headers["x-content-type-options"] == "nosniff"
    assert httpx.get(base + "a/" * 20).status_code == 404


def test_no_path_leads_out_of_the_guide(relay: SharedRelay, page: Path, guide: Path) -> None:
    (page.parent / "secret.txt").write_text("secret")
    (page / "beside.txt").write_text("secret")
    for path in ("../beside.txt", "../../secret.txt", "%2e%2e/beside.txt", "..%2fbeside.txt", "how-to/../x"):
        answer = ask_raw(relay.address, f"/guide/{path}")
        assert answer.startswith(b"HTTP/1.1 404 "), path
        assert b"secret" not in answer, path
    (guide / "link.txt").symlink_to(page.parent / "secret.txt")
    assert b"secret" not in ask_raw(relay.address, "/guide/link.txt").partition(b"\r\n\r\n")[2]


def test_a_recording_in_the_guide_keeps_its_own_policy(relay: SharedRelay, page: Path, guide: Path) -> None:
    policy = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'"
    for name in ("index.html", "embed/index.html", "knee/embed/index.html"):
        entry = guide / "gallery" / name
        entry.parent.mkdir(parents=True, exist_ok=True)
        entry.write_text(f'<meta http-equiv="Content-Security-Policy" content="{policy}">')
    (guide / "gallery/assets").mkdir()
    (guide / "gallery/assets/worker-1a2b3c4d.js").write_text("1")
    base = f"{relay.base}/guide/gallery/"
    for path in ("", "embed/", "knee/embed/index.html", "assets/worker-1a2b3c4d.js"):
        answer = httpx.get(base + path)
        assert answer.status_code == 200
        assert answer.headers["content-security-policy"] == f"{policy}; {FRAMES}"
    for path in ("embed/", "knee/embed/index.html"):
        assert httpx.get(base + path).headers["x-frame-options"] == "SAMEORIGIN"


def test_a_page_without_a_guide_says_so(relay: SharedRelay, page: Path) -> None:
    base = f"{relay.base}/guide/"
    for path in ("", "how-to/share.html"):
        answer = httpx.get(base + path, headers={"accept": "text/html"})
        assert answer.status_code == 404
        assert "`make site` builds it" in answer.text
        assert answer.headers["content-type"].startswith("text/plain")
        assert answer.headers["x-content-type-options"] == "nosniff"
