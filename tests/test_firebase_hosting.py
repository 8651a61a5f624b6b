"""The page on Firebase Hosting, as its emulator serves it with our firebase.json."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator

import httpx
import pytest

from tests.firebase.emulator import ROOT, Emulator, NotHere

CONFIG = ROOT / "infra/hosting/firebase/firebase.json"
DIST = ROOT / "spa/dist"
POLICY = re.compile(r'http-equiv="Content-Security-Policy"\s+content="([^"]+)"')

needs_page = pytest.mark.skipif(not (DIST / "index.html").exists(), reason="no built page: run make setup")


def own_policy() -> str:
    """The built page's Content-Security-Policy."""
    found = POLICY.search((DIST / "index.html").read_text())
    assert found is not None
    return found[1].replace("&#39;", "'")


@needs_page
def test_its_headers_say_what_the_page_says() -> None:
    said = re.findall(r'"Content-Security-Policy",\s*"value": "([^"]+)"', CONFIG.read_text())
    assert len(said) == 4
    assert {each.partition("; frame-ancestors ")[0] for each in said} == {own_policy()}


@pytest.fixture(scope="module")
def hosting(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Its address."""
    folder = tmp_path_factory.mktemp("hosting")
    shutil.copytree(DIST, folder / "page")
    try:
        made = Emulator(folder, "hosting", json.loads(CONFIG.read_text()))
    except NotHere as e:
        pytest.skip(str(e))
    yield f"http://{made.host}"
    made.stop()


@pytest.mark.full
@needs_page
def test_the_emulator_serves_the_page_with_its_headers(hosting: str) -> None:
    worker = next((DIST / "assets").glob("worker-*.js")).name
    for path, cache, frames in (
        ("/", "no-cache", "'none'"),
        ("/config.json", "no-cache", "'none'"),
        (f"/assets/{worker}", "public, max-age=31536000, immutable", "'none'"),
        ("/embed/demo", "no-cache", "*"),
        ("/embed/hubo", "no-cache", "'self'"),
        ("/embed/", "no-cache", "'self'"),
        ("/guide/gallery.html", "no-cache", "'none'"),
        ("/guide/gallery/knee/embed/index.html", "no-cache", "'self'"),
        (f"/guide/gallery/assets/{worker}", "public, max-age=31536000, immutable", "'none'"),
    ):
        answer = httpx.get(hosting + path, trust_env=False)
        assert answer.status_code == 200, path
        assert answer.headers["cache-control"] == cache, path
        assert answer.headers["content-security-policy"] == f"{own_policy()}; frame-ancestors {frames}", path
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
        readers = "*" if path == "/config.json" or path.startswith("/assets/") else None
        assert answer.headers.get("access-control-allow-origin") == readers, path
        isolated = "require-corp" if path.startswith(("/embed/", "/assets/")) else None
        assert answer.headers.get("cross-origin-embedder-policy") == isolated, path
        if path.startswith("/embed/"):
            assert answer.text == (DIST / "embed/index.html").read_text()
    # what `ignore` names is not sent to Firebase by a deploy; the emulator serves the folder as it lies
    for gone in ("/assets/gone.js", "/nothing", "/embed/demo/x"):
        answer = httpx.get(hosting + gone, trust_env=False)
        assert answer.status_code == 404, gone
        assert 'id="root"' not in answer.text, "never the page instead"
