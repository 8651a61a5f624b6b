"""The routes of a running relay."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import zenoh
from posecast_relay.http.answers import Readiness, RobotDetails, RobotList, RobotState
from posecast_relay.http.app import NO_PAGE
from posecast_testing import until
from posecast_wire.keys import alive_key

from .past_doors import PastDoors
from .sim import mixed
from .stage import Model, Relay, SharedRelay, Watcher, client_config
from .test_admin import Lab

MESH = bytes(range(256)) * 2500  # 640 kB: three ranges


def listed(relay: Relay) -> list[dict[str, Any]]:
    """What the list says of its robot, and of those named after it."""
    found = httpx.get(f"{relay.base}/api/v1/robots").json()["robots"]
    return [each for each in found if each["robot"].partition("-")[0] == relay.robot]


def on_air(relay: Relay) -> bool:
    found = listed(relay)
    return bool(found) and found[0]["status"] == "online" and found[0]["hz"] is not None


PROXIED = ("X-Forwarded-For", "X-Forwarded-Proto", "Forwarded", "X-Real-IP", "Via", "CF-Connecting-IP")


def test_where_to_publish_is_told_at_this_machine_only(relay: Relay) -> None:
    port = relay.address.rpartition(":")[2]
    base = f"{relay.base}/api/v1/robots"

    def told(**headers: str) -> Any:
        answer = httpx.get(base, headers={name.replace("_", "-"): of for name, of in headers.items()})
        assert "origin" in answer.headers["vary"]
        return answer.json().get("publish_at")

    own: tuple[dict[str, str], ...] = (
        {},
        {"host": f"localhost:{port}"},
        {"host": f"[::1]:{port}"},
        {"host": f"localhost:{port}", "origin": f"http://localhost:{port}"},
    )
    for headers in own:
        assert told(**headers) == relay.zenoh, headers
    elsewhere = (
        *({name: "203.0.113.7"} for name in PROXIED),
        {"origin": "https://evil.example"},
        {"origin": "null"},
        {"host": "evil.example"},
        {"host": f"evil.example:{port}", "origin": f"http://evil.example:{port}"},
        {"host": f"localhost.evil.example:{port}"},
    )
    for headers in elsewhere:
        assert told(**headers) is None, headers
    assert told() == relay.zenoh, "what others were told is not kept for this machine"


async def test_the_list_and_one_robot(relay: Relay, edges: Any) -> None:
    base = f"{relay.base}/api/v1/robots"
    missing = httpx.get(relay.api)
    assert (missing.status_code, missing.json()) == (404, {"error": "no such robot, or you may not see it"})
    edge = edges(relay)
    edge.edge.info = {"mode": "walking"}
    async with Watcher(relay.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 10)
        await asyncio.to_thread(until, "on air", lambda: on_air(relay))
        answer = httpx.get(base)
        assert answer.json()["publish_at"] == relay.zenoh
        (robot,) = listed(relay)
        assert robot["viewers"] == 1
        assert 15 < robot["hz"] < 35  # 30, on a loaded machine
        assert 0 <= robot["age_ms"] < 1500
        assert answer.headers["access-control-allow-origin"] == "*"
        assert answer.headers["cache-control"] == "public, max-age=1"
        again = httpx.get(base, headers={"if-none-match": answer.headers["etag"]})
        assert again.status_code in (200, 304)
        assert again.status_code == 200 or again.content == b""
        await asyncio.to_thread(until, "info", lambda: httpx.get(relay.api).json()["info"], 15.0)
        one = httpx.get(relay.api).json()
    assert one["schema"] == edge_schema(edge)
    assert one["schema_id"] == f"{edge.edge.schema.id:08x}"
    assert one["conflict"] is False
    assert one["model"] is None


def test_a_robot_that_left_is_listed_unless_it_has_never_sent_a_frame(relay: Relay, edges: Any) -> None:
    mute = f"{relay.robot}-mute"

    def statuses() -> dict[str, str]:
        return {robot["robot"]: robot["status"] for robot in listed(relay)}

    spoke = edges(relay)
    with zenoh.open(client_config(relay.zenoh)) as session:
        token = session.liveliness().declare_token(alive_key(mute))
        until("both are there", lambda: statuses() == {relay.robot: "online", mute: "silent"})
        spoke.close()
        token.undeclare()  # type: ignore[no-untyped-call]
    until("both have left", lambda: statuses() == {relay.robot: "offline"})
    for robot in (relay.robot, mute):
        answer = httpx.get(f"{relay.base}/api/v1/robots/{robot}")
        assert answer.status_code == 200, "a link to it says what is known"


def edge_schema(edge: Any) -> dict[str, Any]:
    import json

    return dict(json.loads(edge.edge.schema.text))


def test_an_answer_is_made_once_a_second_and_has_an_etag(relay: Relay) -> None:
    url = f"{relay.base}/api/v1/robots"
    first = httpx.get(url)
    again = httpx.get(url, headers={"if-none-match": first.headers["etag"]})
    assert again.status_code == 304
    assert again.headers["etag"] == first.headers["etag"]


async def test_the_state_as_plain_json(relay: Relay, edges: Any) -> None:
    url = f"{relay.api}/state"
    assert httpx.get(url).status_code == 404
    edge = edges(relay, of=mixed())
    await asyncio.to_thread(until, "a state", lambda: httpx.get(url).status_code == 200)
    edge.silent = True
    await asyncio.sleep(0)
    codes = None
    while codes != edge.edge.codes:
        codes = edge.edge.codes
        await asyncio.to_thread(until, "the newest", lambda: httpx.get(url).json().get("seq") == edge.seq)
    state = httpx.get(url).json()
    pos, flags = state["fields"]["pos"], state["fields"]["flags"]
    assert pos == {"unit": "rad", "values": {"RKN": codes[0] * 0.01, "LKN": codes[1] * 0.01}}
    assert flags["values"]["RKN"] == edge.edge.schema.fields[1].bits_set(codes[2])
    assert state["status"] in ("online", "silent")
    assert httpx.get(url, params={"view": "lab"}).status_code == 403
    head = httpx.head(url)
    assert (head.status_code, head.content, head.headers["content-type"]) == (200, b"", "application/json")
    stream = httpx.head(url.replace("/state", "/live.sse"))
    assert (stream.status_code, stream.headers["allow"]) == (405, "GET")


async def test_a_model_is_fetched_once_verified_and_immutable(relay: Relay, edges: Any) -> None:
    files = {
        "robot.urdf": (b"<robot name='sim'/>", "application/xml"),
        "meshes/knee.stl": (MESH, "model/stl"),
        "evil.html": (b"<script>alert(1)</script>", "text/html"),
        "empty.txt": (b"", "text/plain"),
    }
    model = Model(files)
    edges(relay, model=model)
    base = f"{relay.api}/model/{model.digest}"
    async with httpx.AsyncClient(timeout=20) as client:

        async def manifest() -> bool:
            return (await client.get(base + "/manifest.json")).status_code == 200

        for _ in range(200):
            if await manifest():
                break
            await asyncio.sleep(0.05)
        answer = await client.get(base + "/manifest.json")
        assert answer.content == model.manifest
        assert answer.headers["content-type"] == "application/json"
        assert model.asked.count("manifest") == 1
        many = await asyncio.gather(*(client.get(base + "/meshes/knee.stl") for _ in range(8)))
        assert all(one.status_code == 200 and one.content == MESH for one in many)
        assert sum(part != "manifest" for part in model.asked) == 3  # ranges, whoever asked
        headers = many[0].headers
        assert headers["content-type"] == "model/stl"
        assert headers["cache-control"] == "public, max-age=31536000, immutable"
        assert headers["access-control-allow-origin"] == "*"
        assert headers["x-content-type-options"] == "nosniff"
        known = await client.get(base + "/meshes/knee.stl", headers={"if-none-match": headers["etag"]})
        assert (known.status_code, known.content) == (304, b"")
        url = base + "/meshes/knee.stl"
        plain = await client.get(url, headers={"accept-encoding": "identity"})
        assert headers["content-encoding"] == "gzip"
        assert int(headers["content-length"]) < len(MESH) / 10
        assert plain.content == MESH
        assert "content-encoding" not in plain.headers
        assert plain.headers["vary"] == headers["vary"] == "accept-encoding"
        head = await client.head(url, headers={"accept-encoding": "identity"})
        assert (head.status_code, head.content, head.headers["content-length"]) == (200, b"", str(len(MESH)))
        evil = await client.get(base + "/evil.html")
        assert evil.headers["content-type"] == "application/octet-stream"
        assert "sandbox" in evil.headers["content-security-policy"]
        assert (await client.get(base + "/empty.txt")).content == b""
        for missing in ("/nothing.stl", "/../../../etc/passwd", "/%2e%2e/x"):
            gone = await client.get(base + missing)
            assert gone.status_code == 404
            assert "error" in gone.json()
        other = await client.get(base.replace(model.digest, "0" * 64) + "/manifest.json")
        assert other.status_code == 404


async def test_a_file_that_is_not_what_its_manifest_says_is_refused(relay: Relay, edges: Any) -> None:
    model = Model({"a.stl": (b"true", "model/stl"), "gone.stl": (b"gone", "model/stl")})
    for digest, data in list(model.files.items()):
        if data == b"gone":
            del model.files[digest]
        else:
            model.files[digest] = b"fake"
    edges(relay, model=model)
    base = f"{relay.api}/model/{model.digest}"
    await asyncio.to_thread(until, "manifest", lambda: httpx.get(base + "/manifest.json").status_code == 200)
    for path, retry_s in (("/a.stl", "15"), ("/gone.stl", "5")):
        answer = httpx.get(base + path)
        assert answer.status_code == 503
        assert answer.headers["retry-after"] == retry_s
        assert answer.headers.get("cache-control") is None


@pytest.fixture
def page(relay: SharedRelay) -> Path:
    folder = relay.page
    (folder / "assets").mkdir()
    (folder / "index.html").write_text("<!doctype html><title>page</title>")
    (folder / "assets" / "app-1a2b.js").write_text("1")
    return folder


def test_the_page_and_never_instead_of_an_answer(relay: SharedRelay, page: Path) -> None:
    base = relay.base
    index = httpx.get(base + "/")
    assert "<title>page" in index.text
    assert index.headers["cache-control"] == "no-cache"
    asset = httpx.get(base + "/assets/app-1a2b.js")
    assert asset.headers["cache-control"] == "public, max-age=31536000, immutable"
    assert asset.headers["content-type"].startswith("text/javascript")
    for path in ("/api/v1/nothing", "/api/v1/robots/r/model/x/y", "/nothing.html", "/assets/gone.js"):
        answer = httpx.get(base + path)
        assert answer.status_code == 404
        assert "<title>" not in answer.text
    assert httpx.get(base + "/livez").text == "ok\n"
    assert httpx.get(base + "/readyz").json() == {"status": "ready"}
    assert "/api/v1/robots/{robot}/state" in httpx.get(base + "/openapi.json").json()["paths"]
    assert httpx.get(base + "/docs").status_code == 404
    assert httpx.get(base + "/metrics").status_code == 404


def test_the_pages_own_policy_is_sent_as_a_header_too(relay: SharedRelay, page: Path) -> None:
    policy = '<meta http-equiv="Content-Security-Policy" content="default-src &#39;self&#39;; img-src *">'
    (page / "index.html").write_text(f"<!doctype html><head>{policy}<title>page</title>")
    base = relay.base
    for path in ("/", "/assets/app-1a2b.js"):  # a worker's script as well: what the page says doesn't bind it
        answer = httpx.get(base + path)
        frames = "; frame-ancestors 'none'" if path == "/" else ""
        assert answer.headers["content-security-policy"] == "default-src 'self'; img-src *" + frames
        assert answer.headers["x-content-type-options"] == "nosniff"
    page_headers = httpx.get(base + "/").headers
    assert page_headers["x-frame-options"] == "DENY"
    assert page_headers["referrer-policy"] == "no-referrer"
    (page / "other.html").write_text("<!doctype html><title>its own")
    for path in ("/livez", "/other.html"):
        assert "content-security-policy" not in httpx.get(base + path).headers
    (page / "index.html").write_text("<!doctype html><title>built anew")
    os.utime(page / "index.html", (0, 0))
    assert "content-security-policy" not in httpx.get(base + "/").headers


def test_a_frame_without_an_origin_may_read_the_files_that_are_alike_for_everybody(
    relay: SharedRelay, page: Path
) -> None:
    (page / "config.json").write_text("{}")
    base = relay.base
    for path, readers in (
        ("/assets/app-1a2b.js", "*"),
        ("/config.json", "*"),
        ("/", None),
        ("/r/demo", None),
    ):
        answer = httpx.get(base + path, headers={"origin": "null"})
        assert answer.status_code == 200, path
        assert answer.headers.get("access-control-allow-origin") == readers, path
        assert "access-control-allow-credentials" not in answer.headers


def test_a_frames_page_says_which_pages_may_frame_its_robot(relays: Any, page: Path, tmp_path: Path) -> None:
    policy = '<meta http-equiv="Content-Security-Policy" content="default-src &#39;self&#39;">'
    (page / "embed").mkdir()
    for path in (page / "index.html", page / "embed/index.html"):
        path.write_text(f"<!doctype html><head>{policy}<title>page</title>")
    robots = tmp_path / "robots.toml"
    rules = (
        "[robots.open.anyone]\n[robots.course.anyone]\nframes=['https://course.example']\n[robots.lab.link]\n"
    )
    robots.write_text(rules)
    robots.chmod(0o600)
    listed = ("--origins", "https://lab.example")
    base = f"http://{relays('--static', str(page), '--robots', str(robots), *listed).address}"

    def ancestors(path: str, **headers: str) -> str:
        answer = httpx.get(base + path, headers=headers, follow_redirects=True)
        assert answer.status_code == 200, path
        assert "<title>page" in answer.text
        assert answer.headers["cache-control"] == "no-cache"
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert answer.headers["cross-origin-embedder-policy"] == "require-corp"
        assert answer.headers["cross-origin-resource-policy"] == "cross-origin"
        own, _, frames = answer.headers["content-security-policy"].partition("; frame-ancestors ")
        assert own == "default-src 'self'"
        assert ("x-frame-options" in answer.headers) is (frames == "'none'"), "an old browser knows no other"
        return frames

    assert ancestors("/embed/open") == "*"
    assert ancestors("/embed/course") == "'self' https://course.example"
    hidden = "'self' https://lab.example"
    # none is named, where the fragment may name any: /embed/, and what is hidden is as what is not there
    for asked in ("/embed/", "/embed/index.html", "/embed/lab", "/embed/no-such", "/embed/%6cab"):
        assert ancestors(asked) == hidden, asked
    slashed = httpx.get(f"{base}/embed/open/?gestures=all")
    assert (slashed.status_code, slashed.headers["location"]) == (307, "../open?gestures=all")
    assert ancestors("/embed/course/") == "'self' https://course.example"
    for asked in ("/", "/embed//", "/embed/lab//"):
        answer = httpx.get(base + asked)
        found = answer.headers.get("content-security-policy", "")
        assert answer.status_code == 404 or found.endswith("frame-ancestors 'none'"), asked
    for asked in ("/embed/LAB", "/embed/lab/x", "/embed/gone.js"):
        assert httpx.get(base + asked).status_code == 404, asked

    first = httpx.get(base + "/embed/open")
    assert "etag" not in first.headers
    robots.write_text(rules.replace("[robots.open.anyone]", "[robots.open.link]"))
    date = first.headers["date"]  # whoever has it already is told anew, though the file is the same
    until(
        "the file has been read anew",
        lambda: ancestors("/embed/open", **{"if-modified-since": date}) == hidden,
    )


async def test_a_relay_without_a_page_says_so() -> None:
    async with PastDoors(None) as doors:
        answer = await doors.client.get(f"http://127.0.0.1:{doors.port}/")
    assert (answer.status_code, answer.text) == (404, NO_PAGE)
    assert "--static DIR" in NO_PAGE


# ---- /openapi.json: every route says what it answers, and the answers are so ---------


@pytest.fixture
def lab_with_past(tmp_path: Path, relays: Callable[..., Relay]) -> Lab:
    """Which has all routes that there are."""
    return Lab(tmp_path, relays, "--past", "memory:")


def list_answers(document: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Route, status, and schema by media type, of what is answered when nothing is refused."""
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            for status, answer in operation["responses"].items():
                if status.startswith("2") and status != "204":
                    yield f"{method.upper()} {path}", status, answer.get("content", {})


def test_every_route_says_what_it_answers(lab_with_past: Lab) -> None:
    document = httpx.get(f"http://{lab_with_past.relay.address}/openapi.json").json()
    answers = list(list_answers(document))
    assert len(answers) > 15
    for route, status, content in answers:
        assert content, f"{route} {status} says nothing of its answer"
        for media_type, told in content.items():
            assert told.get("schema"), f"{route} {status} {media_type}: an empty schema"
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            assert operation["summary"], f"{method} {path}"
            assert operation["responses"]["default"]["content"]["application/json"]["schema"], path


def test_answers_are_as_described(relay: Relay, edges: Any) -> None:
    """With every member that the description names for these, and no other."""

    def ask(path: str) -> Any:
        answer = httpx.get(relay.base + path)
        return answer.json() if answer.status_code == 200 else None

    edges(relay)
    state = RobotState.model_validate(until("a state", lambda: ask(f"{relay.path}/state")), strict=True)
    assert state.model_fields_set == RobotState.model_fields.keys()
    details = RobotDetails.model_validate(ask(relay.path))
    assert details.model_fields_set == RobotDetails.model_fields.keys()

    def is_listed() -> bool:
        robots = RobotList.model_validate(ask("/api/v1/robots")).robots
        return relay.robot in [each.robot for each in robots]

    until("the list, a second old, has it", is_listed)
    assert Readiness.model_validate(ask("/readyz")).status == "ready"
