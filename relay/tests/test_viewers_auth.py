"""Who may watch: share links and signed-in accounts, at every door. Real sockets, real signatures."""

from __future__ import annotations

import asyncio
import base64
import json
import logging
import time
from collections.abc import AsyncIterator, Iterator, Mapping
from types import SimpleNamespace
from typing import Any

import firebase_admin
import httpx
import jwt
import pytest
import uvicorn
import websockets
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.x509.oid import NameOID
from firebase_admin import auth
from posecast_relay.auth.access import open_access
from posecast_relay.auth.firebase import Firebase
from posecast_relay.auth.tokens import PATIENCE_S, Tokens, Unverifiable
from posecast_relay.core.delayed import DelayedHub
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import Audience, Policy, Principal, Rule, make_link
from posecast_relay.http.app import make_app
from posecast_relay.models.cache import ModelCache
from posecast_relay.net.encodings import DecodeCache
from posecast_relay.net.sse import make_http_protocol
from posecast_relay.net.websocket import make_live_protocol
from posecast_relay.runtime.dispatcher import MemoryStore
from posecast_relay.runtime.fan_out import FanOut
from posecast_relay.zenoh.models import EdgeModels
from posecast_wire import Close

from .sim import Edge, schema

PROJECT = "posecast-test"
KEY = "k" * 43
A, S, L = Audience.ANYONE, Audience.SIGNED_IN, Audience.LINK
RULES = {"open": {A: Rule(), L: Rule("lab")}, "lab": {S: Rule("lab")}, "shared": {L: Rule()}}


# ---- Google's part, with a key of the test's own ------------------------------------


class Google:
    """Signs tokens as Firebase does, and serves the certificate to check them by."""

    def __init__(self) -> None:
        self.key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
        self.other = rsa.generate_private_key(public_exponent=65537, key_size=2048)
        name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "test")])
        from datetime import UTC, datetime, timedelta

        now = datetime.now(UTC)
        certificate = (
            x509.CertificateBuilder()
            .subject_name(name)
            .issuer_name(name)
            .public_key(self.key.public_key())
            .serial_number(1)
            .not_valid_before(now - timedelta(days=1))
            .not_valid_after(now + timedelta(days=1))
            .sign(self.key, hashes.SHA256())
        )
        self.pem = certificate.public_bytes(serialization.Encoding.PEM).decode()
        self.away = False

    def __call__(self, url: str, method: str = "GET", **_more: object) -> object:
        """The transport that firebase-admin fetches certificates with."""
        if self.away:
            raise ConnectionError("no way out")
        return SimpleNamespace(status=200, headers={}, data=json.dumps({"kid": self.pem}).encode())

    def token(self, key: Any = None, algorithm: str = "RS256", kid: str | None = "kid", **claims: Any) -> str:
        """A good one, but for what is said otherwise; a claim that is None is left out."""
        now = int(time.time())
        good: dict[str, Any] = {
            "aud": PROJECT,
            "iss": f"https://securetoken.google.com/{PROJECT}",
            "sub": "someone",
            "iat": now - 10,
            "auth_time": now - 10,
            "exp": now + 3600,
        }
        body = {name: value for name, value in (good | claims).items() if value is not None}
        signing = self.key if key is None and algorithm == "RS256" else key
        return jwt.encode(body, signing, algorithm, headers={"kid": kid} if kid else {})


@pytest.fixture(scope="module")
def google() -> Google:
    """One key for all tests."""
    return Google()


@pytest.fixture
def accounts(google: Google) -> Iterator[Firebase]:
    """firebase-admin with its network replaced. Loud when its insides are others by now."""
    google.away = False
    found = Firebase(PROJECT, check_revoked=False)
    verifier = auth._get_client(found.app)._token_verifier
    assert hasattr(verifier, "request"), "firebase-admin has changed: pin the version, mend this test"
    assert verifier.request.timeout_seconds == PATIENCE_S, "it waits longer than anybody, and takes a thread"
    verifier.request = google
    yield found
    firebase_admin.delete_app(found.app)


def forge(google: Google) -> dict[str, str]:
    """The classes of bad token."""
    good = google.token()
    head, body, signature = good.split(".")
    now = int(time.time())
    said = json.loads(base64.urlsafe_b64decode(body + "=="))
    altered = base64.urlsafe_b64encode(json.dumps(said | {"sub": "admin"}).encode()).rstrip(b"=").decode()
    import hmac as hmac_module

    confused_head = base64.urlsafe_b64encode(b'{"alg":"HS256","kid":"kid","typ":"JWT"}').rstrip(b"=").decode()
    mac = hmac_module.digest(google.pem.encode(), f"{confused_head}.{body}".encode(), "sha256")
    confused = f"{confused_head}.{body}.{base64.urlsafe_b64encode(mac).rstrip(b'=').decode()}"
    return {
        "wrong key": google.token(google.other),
        "alg none": google.token(None, "none"),
        "HS256 by the public key": confused,
        "unknown kid": google.token(kid="other"),
        "no kid": google.token(kid=None),
        "wrong audience": google.token(aud="other-project"),
        "wrong issuer": google.token(iss="https://securetoken.google.com/other"),
        "expired": google.token(iat=now - 7200, exp=now - 3600),
        "from the future": google.token(iat=now + 3600, exp=now + 7200),
        "no subject": google.token(sub=None),
        "a subject of 129 letters": google.token(sub="x" * 129),
        "altered": f"{head}.{altered}.{signature}",
        "garbage": "not.a.token",
        "empty": "",
    }


def test_a_good_token_and_fourteen_bad_ones(google: Google, accounts: Firebase) -> None:
    good = accounts.verify(google.token())
    assert good is not None
    assert good.audience is S
    assert good.until_s > time.time() + 3000
    bad = forge(google)
    assert len(bad) == 14
    for what, token in bad.items():
        assert accounts.verify(token) is None, what


def test_when_google_does_not_answer_nobody_is_called_a_liar(google: Google, accounts: Firebase) -> None:
    google.away = True
    with pytest.raises(Unverifiable):
        accounts.verify(google.token())


# ---- a relay in this process --------------------------------------------------------


class Doors:
    """The relay's doors over a hub that the test feeds itself."""

    def __init__(self, accounts: Any, origins: tuple[str, ...]) -> None:
        limits = Limits(sweep_s=0.1)
        self.tokens = Tokens(accounts, {"open": KEY, "shared": KEY})
        self.access = open_access(
            *(Hub(limits), DelayedHub(limits), MemoryStore(), FanOut(None)),
            policy=Policy(RULES),
            tokens=self.tokens,
            origins=origins,
        )
        self.dispatcher = self.access.live
        now = self.dispatcher.now()
        for robot in ("open", "lab", "shared"):
            edge = Edge(0xE, schema(("RKN", f"secret-of-{robot}")), began_s=now)
            for view in ("public", "lab"):
                self.dispatcher.carry_out(self.dispatcher.hub.set_token(robot, True, now))
                data = edge.frame(now, force_key=True)
                self.dispatcher.hub.receive_frame(robot, view, data, edge.stamp(now), now)
                self.dispatcher.hub.take_snapshot(robot, view, edge.snapshot(), edge.stamp(now), now)
        self.dispatcher.flush()
        self.address = ""

    async def start(self) -> uvicorn.Server:
        """Serve on a free port."""
        decoded, none = DecodeCache(), SimpleNamespace()
        app = make_app(self.access, ModelCache(EdgeModels(none, self.dispatcher.hub), 1), decoded, None)  # type: ignore[arg-type]
        config = uvicorn.Config(
            app,
            port=0,
            ws=make_live_protocol(self.access, decoded),
            http=make_http_protocol(self.access, decoded),
            lifespan="off",
            log_config=None,
        )
        server = uvicorn.Server(config)
        for dispatcher in self.access.dispatchers:
            dispatcher.start()
        self.task = asyncio.create_task(server.serve())
        while not server.started:
            await asyncio.sleep(0.01)
        host, port = server.servers[0].sockets[0].getsockname()[:2]
        self.address = f"{host}:{port}"
        return server

    async def watch(self, robot: str, first: str | None = None, query: str = "", **headers: str) -> list[Any]:
        """What a viewer is told until it has its schema or the end; the close code last, 0 if it goes on."""
        url = f"ws://{self.address}/api/v1/robots/{robot}/live{query}"
        said: list[Any] = []
        async with websockets.connect(url, additional_headers=headers, proxy=None) as link:
            if first is not None:
                await link.send(json.dumps({"type": "auth", "token": first}))
            try:
                async for message in link:
                    said.append(json.loads(message) if isinstance(message, str) else message)
                    if isinstance(message, str) and said[-1]["type"] == "schema":
                        return [*said, 0]
            except websockets.ConnectionClosed:
                pass
            return [*said, link.close_code]

    async def get(self, path: str, token: str | None = None, **headers: str) -> httpx.Response:
        """A request with a token in its header."""
        if token is not None:
            headers["authorization"] = f"Bearer {token}"
        async with httpx.AsyncClient(trust_env=False) as client:
            return await client.get(f"http://{self.address}/api/v1/robots{path}", headers=headers)


@pytest.fixture
async def doors(accounts: Firebase) -> AsyncIterator[Doors]:
    """On air."""
    found = Doors(accounts, ("https://good.com",))
    server = await found.start()
    yield found
    server.should_exit = True
    await found.task
    for dispatcher in found.access.dispatchers:
        dispatcher.stop()


def link(robot: str, seconds: float = 1000, key: str = KEY) -> str:
    """A share link's token."""
    return make_link(key, robot, int(time.time() + seconds), "abcdefgh")


def view_of(said: list[Any]) -> str:
    """Of a viewer that was let in."""
    assert said[-1] == 0, said
    found: str = said[0]["view"]
    return found


async def test_a_token_comes_by_header_or_first_message(doors: Doors, google: Google) -> None:
    token = google.token()
    assert view_of(await doors.watch("lab", token, "?auth=1")) == "lab"
    assert view_of(await doors.watch("lab", Authorization=f"Bearer {token}")) == "lab"
    assert view_of(await doors.watch("shared", link("shared"), "?auth=1")) == "public"
    assert view_of(await doors.watch("open", link("open"), "?auth=1")) == "lab"
    assert view_of(await doors.watch("open", link("open"), "?auth=1&view=public")) == "public"
    assert view_of(await doors.watch("open")) == "public"
    for path in ("/lab", "/lab/state"):
        answer = await doors.get(path, token)
        assert answer.status_code == 200
        assert "secret-of-lab" in answer.text
        assert answer.headers["cache-control"] == "no-store"
        assert "access-control-allow-origin" not in answer.headers
        assert (await doors.get(path)).status_code == 404
    listed = {who: [r["robot"] for r in (await doors.get("", who)).json()["robots"]] for who in (None, token)}
    assert listed == {None: ["open"], token: ["lab", "open"]}
    assert [r["robot"] for r in (await doors.get("", link("shared"))).json()["robots"]] == ["open", "shared"]


async def test_fourteen_bad_tokens_get_4401_and_401_and_no_500(doors: Doors, google: Google) -> None:
    for what, token in forge(google).items():
        if token:  # an empty one is no `auth` message
            said = await doors.watch("lab", token, "?auth=1")
            assert [doc["type"] for doc in said[:-1]] == ["bye"], what
            assert said[-1] == Close.TOKEN, what
            for path in ("", "/lab", "/lab/state", "/open/state", "/lab/live.sse"):
                assert (await doors.get(path, token)).status_code == 401, (what, path)
    assert (await doors.watch("lab", "", "?auth=1"))[-1] == Close.NOT_ALLOWED
    for bad in (link("shared", -1), link("shared", key="x" * 43), link("absent"), "L1.x"):
        assert (await doors.watch("shared", bad, "?auth=1"))[-1] == Close.TOKEN
        assert (await doors.get("/shared/state", bad)).status_code == 401


class Asked(dict[str, Any]):
    """Robots, and the names by which somebody looked for one."""

    def __init__(self, robots: Mapping[str, Any]) -> None:
        super().__init__(robots)
        self.names: set[str] = set()

    def get(self, name: str, default: Any = None) -> Any:
        self.names.add(name)
        return super().get(name, default)

    def __getitem__(self, name: str) -> Any:
        self.names.add(name)
        return super().__getitem__(name)

    def __contains__(self, name: object) -> bool:
        self.names.add(str(name))
        return super().__contains__(name)


async def test_a_robot_that_is_not_for_them_is_as_one_that_is_not(doors: Doors, google: Google) -> None:
    token = google.token()
    for dispatcher in doors.access.dispatchers:
        dispatcher.hub.robots = Asked(dispatcher.hub.robots)
    assert (await doors.get("/open/state")).status_code == 200
    for who in (None, token, link("open")):
        answers = set()
        for robot in ("shared", "absent"):
            said = await doors.watch(robot, who, "?auth=1" if who else "")
            texts = [json.dumps(doc) for doc in said]
            for path in ("", "/state", "/live.sse", f"/model/{'0' * 64}/manifest.json"):
                answer = await doors.get(f"/{robot}{path}", who)
                texts.append(f"{answer.status_code} {answer.text} {answer.headers.get('cache-control')}")
            answers.add(tuple(texts))
        assert len(answers) == 1
        assert answers.pop()[1] == str(int(Close.ABSENT))
    looked_for = set().union(*(dispatcher.hub.robots.names for dispatcher in doors.access.dispatchers))  # type: ignore[attr-defined]
    assert looked_for == {"open"}, "the rules alone decide, so both answers take the same time"


async def test_what_is_not_for_everybody_is_not_for_every_page(doors: Doors, google: Google) -> None:
    token = google.token()
    url = f"ws://{doors.address}/api/v1/robots/lab/live?auth=1"
    for origin in ("https://good.com.evil.com", "https://evil.com", "null"):
        with pytest.raises(websockets.InvalidStatus) as refused:
            await websockets.connect(url, additional_headers={"Origin": origin}, proxy=None)
        assert refused.value.response.status_code == 403
        for path in ("/lab/state", "/lab/live.sse"):
            answer = await doors.get(path, token, origin=origin)
            assert answer.status_code == 403
            assert "secret" not in answer.text
        assert view_of(await doors.watch("open", Origin=origin)) == "public"
    for origin in ("https://good.com", f"http://{doors.address}"):
        assert view_of(await doors.watch("lab", token, "?auth=1", Origin=origin)) == "lab"
        answer = await doors.get("/lab/state", token, origin=origin)
        assert answer.headers["access-control-allow-origin"] == origin


async def test_a_viewer_is_let_go_when_its_token_expires(doors: Doors) -> None:
    said = await doors.watch("shared", link("shared", 2.5), "?auth=1")
    assert view_of(said) == "public"
    url = f"ws://{doors.address}/api/v1/robots/shared/live?auth=1"
    async with websockets.connect(url, proxy=None) as viewer:
        await viewer.send(json.dumps({"type": "auth", "token": link("shared", 2.5)}))
        async with asyncio.timeout(15):
            await viewer.wait_closed()
        assert viewer.close_code == Close.TOKEN


async def test_a_newer_token_prolongs_and_a_worse_one_ends_it(doors: Doors) -> None:
    url = f"ws://{doors.address}/api/v1/robots/shared/live?auth=1"
    async with websockets.connect(url, proxy=None) as viewer:
        await viewer.send(json.dumps({"type": "auth", "token": link("shared", 500)}))
        (watching,) = await _viewers(doors, 1)
        before = watching.expires_at
        await viewer.send(json.dumps({"type": "auth", "token": link("shared", 9000)}))
        async with asyncio.timeout(10):
            while watching.expires_at < before + 8000:
                await asyncio.sleep(0.01)
        await viewer.send(json.dumps({"type": "auth", "token": link("shared", 9000, "x" * 43)}))
        async with asyncio.timeout(10):
            await viewer.wait_closed()
        assert viewer.close_code == Close.TOKEN


async def _viewers(doors: Doors, count: int) -> list[Any]:
    async with asyncio.timeout(10):
        while len(doors.dispatcher.hub.viewers) < count:
            await asyncio.sleep(0.01)
    return list(doors.dispatcher.hub.viewers)


async def test_links_and_accounts_that_are_revoked_end_at_once(doors: Doors, google: Google) -> None:
    base = f"ws://{doors.address}/api/v1/robots"
    async with (
        websockets.connect(f"{base}/shared/live?auth=1", proxy=None) as by_link,
        websockets.connect(f"{base}/lab/live?auth=1", proxy=None) as by_account,
        websockets.connect(f"{base}/open/live", proxy=None) as anyone,
    ):
        await by_link.send(json.dumps({"type": "auth", "token": link("shared")}))
        await by_account.send(json.dumps({"type": "auth", "token": google.token()}))
        await _viewers(doors, 3)
        doors.tokens.set_link_keys({"shared": "n" * 43})
        doors.access.set_policy(Policy(RULES))
        async with asyncio.timeout(10):
            await by_link.wait_closed()
        assert by_link.close_code == Close.TOKEN
        google.away = True  # what can't be found out changes nothing
        await doors.access.recheck_once()
        google.away = False
        assert len(doors.dispatcher.hub.viewers) == 2

        def revoked(_token: str) -> Principal | None:
            return None

        doors.tokens._accounts = SimpleNamespace(verify=revoked)
        await doors.access.recheck_once()
        async with asyncio.timeout(10):
            await by_account.wait_closed()
        assert by_account.close_code == Close.TOKEN
        assert len(doors.dispatcher.hub.viewers) == 1
        assert anyone.close_code is None


async def test_a_token_that_does_not_come_ends_it(doors: Doors, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("posecast_relay.net.websocket.TOKEN_S", 0.2)
    assert (await doors.watch("lab", None, "?auth=1"))[-1] == Close.TOKEN


async def test_when_nobody_can_tell_they_come_again(doors: Doors) -> None:
    def away(_token: str) -> Principal | None:
        raise Unverifiable("ConnectionError")

    doors.tokens._accounts = SimpleNamespace(verify=away)
    said = await doors.watch("lab", "some.token.here", "?auth=1")
    assert said[-1] == Close.FULL
    assert said[-2]["retry_s"] > 0
    answer = await doors.get("/lab/state", "some.token.here")
    assert (answer.status_code, answer.headers["retry-after"]) == (503, "30")


async def test_a_token_in_an_address_is_refused_and_nowhere_to_be_found(
    doors: Doors, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    for name in ("token", "access_token"):
        with pytest.raises(websockets.InvalidStatus) as refused:
            await doors.watch("lab", query=f"?{name}=CANARY-7319")
        assert refused.value.response.status_code == 400
        for path in ("", "/lab", "/lab/state", "/lab/live.sse", f"/lab/model/{'0' * 64}/manifest.json"):
            assert (await doors.get(f"{path}?{name}=CANARY-7319")).status_code == 400, path
    await doors.watch("lab", "CANARY-7319", "?auth=1")
    await doors.get("/lab", "CANARY-7319")
    theirs = ("posecast", "uvicorn.error")  # a relay keeps no access log: `serve`
    mine = [record for record in caplog.records if record.name.startswith(theirs)]
    assert not any("CANARY-7319" in record.getMessage() for record in mine)
