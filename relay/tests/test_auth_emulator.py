"""Accounts of the real Auth emulator at a relay with `--dev`. It signs no token: that is its purpose."""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import firebase_admin
import pytest
import websockets
from posecast_relay.auth.firebase import Firebase
from posecast_wire import Close

from tests.firebase.auth_emulator import PROJECT, AuthEmulator, NotHere

from .stage import Relay
from .test_viewers_auth import Doors, view_of

pytestmark = pytest.mark.full
RECENT_S = 2.0  # a revocation holds for what was minted in an earlier second


@pytest.fixture(scope="module")
def emulator(tmp_path_factory: pytest.TempPathFactory) -> Iterator[AuthEmulator]:
    """One for all tests: it takes its time to start."""
    try:
        made = AuthEmulator(tmp_path_factory.mktemp("emulator"))
    except NotHere as e:
        pytest.skip(str(e))
    yield made
    made.stop()


@pytest.fixture
async def doors(emulator: AuthEmulator, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Doors]:
    """A relay in this process that asks the emulator about every account."""
    monkeypatch.setenv("FIREBASE_AUTH_EMULATOR_HOST", emulator.host)
    accounts = Firebase(PROJECT, check_revoked=True)
    made = Doors(accounts, ())
    server = await made.start()
    yield made
    server.should_exit = True
    await made.task
    for dispatcher in made.access.dispatchers:
        dispatcher.stop()
    firebase_admin.delete_app(accounts.app)


def unsigned(token: str, **claims: object) -> str:
    """The same with other claims, as only an emulator takes it."""
    head, body, _ = token.split(".")
    said = json.loads(base64.urlsafe_b64decode(body + "==="))
    changed = base64.urlsafe_b64encode(json.dumps(said | claims).encode()).rstrip(b"=").decode()
    return f"{head}.{changed}."


def email() -> str:
    """Of nobody yet."""
    return f"viewer-{time.monotonic_ns()}@example.org"


async def test_an_account_sees_what_is_for_those_who_are_signed_in(
    doors: Doors, emulator: AuthEmulator
) -> None:
    token = emulator.sign_up(email())["idToken"]
    assert view_of(await doors.watch("lab", token, "?auth=1")) == "lab"
    assert (await doors.get("/lab/state", token)).status_code == 200
    assert [r["robot"] for r in (await doors.get("", token)).json()["robots"]] == ["lab", "open"]


async def test_expired_ones_and_those_of_others_are_refused(doors: Doors, emulator: AuthEmulator) -> None:
    token, now = emulator.sign_up(email())["idToken"], int(time.time())
    for claims in (
        {"iat": now - 7200, "exp": now - 3600},
        {"aud": "demo-other"},
        {"iss": "https://securetoken.google.com/demo-other"},
        {"sub": "nobody-of-this-name"},
    ):
        bad = unsigned(token, **claims)
        assert (await doors.watch("lab", bad, "?auth=1"))[-1] == Close.TOKEN, claims
        assert (await doors.get("/lab/state", bad)).status_code == 401, claims


async def test_one_that_expires_while_it_is_used_ends(doors: Doors, emulator: AuthEmulator) -> None:
    token = unsigned(emulator.sign_up(email())["idToken"], exp=int(time.time()) + 4)
    async with watching(doors, token) as viewer:
        await viewer.wait_closed()
        assert viewer.close_code == Close.TOKEN


@pytest.mark.parametrize("how", ["disabled", "revoked"])
async def test_who_is_disabled_or_revoked_is_let_go_and_not_let_in(
    doors: Doors, emulator: AuthEmulator, how: str
) -> None:
    account = emulator.sign_up(email())
    other = emulator.sign_up(email())["idToken"]
    async with watching(doors, account["idToken"]) as viewer, watching(doors, other) as stays:
        await doors.access.recheck_once()
        assert len(doors.dispatcher.hub.viewers) == 2
        valid_since = str(int(time.time() + RECENT_S))
        change: dict[str, Any] = {"disableUser": True} if how == "disabled" else {"validSince": valid_since}
        emulator.change(account["localId"], **change)
        await doors.access.recheck_once()
        await viewer.wait_closed()
        assert viewer.close_code == Close.TOKEN
        assert (await doors.watch("lab", account["idToken"], "?auth=1"))[-1] == Close.TOKEN
        assert (await doors.get("/lab", account["idToken"])).status_code == 401
        assert stays.close_code is None
        assert len(doors.dispatcher.hub.viewers) == 1


class watching:
    """A viewer of the private robot `lab` who has been let in."""

    def __init__(self, doors: Doors, token: str) -> None:
        self.doors, self.token = doors, token

    async def __aenter__(self) -> websockets.ClientConnection:
        url = f"ws://{self.doors.address}/api/v1/robots/lab/live?auth=1"
        self.link = await websockets.connect(url, proxy=None)
        await self.link.send(json.dumps({"type": "auth", "token": self.token}))
        async for message in self.link:
            if isinstance(message, str) and json.loads(message)["type"] == "schema":
                return self.link
        raise AssertionError(f"not let in: {self.link.close_code}")

    async def __aexit__(self, *_error: object) -> None:
        await self.link.close()


def test_without_dev_a_relay_does_not_start_with_an_emulator(emulator: AuthEmulator, tmp_path: Path) -> None:
    robots = tmp_path / "robots.toml"
    robots.write_text("[robots.lab.signed-in]\n")
    robots.chmod(0o600)
    environ = os.environ | {"FIREBASE_AUTH_EMULATOR_HOST": emulator.host}
    command = [sys.executable, "-m", "posecast_relay.cli", "run", "--robots", str(robots), "--port", "0"]
    command += ["--firebase-project", PROJECT]
    refused = subprocess.run(command, env=environ, capture_output=True, text=True, timeout=60, check=False)
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert "FIREBASE_AUTH_EMULATOR_HOST is set" in refused.stderr


async def test_with_dev_a_relay_of_its_own_process_lets_accounts_in(
    emulator: AuthEmulator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robots = tmp_path / "robots.toml"
    robots.write_text("[robots.lab.signed-in]\n")
    robots.chmod(0o600)
    monkeypatch.setenv("FIREBASE_AUTH_EMULATOR_HOST", emulator.host)
    relay = Relay(tmp_path, "--robots", str(robots), "--firebase-project", PROJECT, "--firebase-revoked")
    try:
        for token, welcome in ((emulator.sign_up(email())["idToken"], True), ("not.a.token", False)):
            async with websockets.connect(relay.url("lab", "?auth=1"), proxy=None) as link:
                await link.send(json.dumps({"type": "auth", "token": token}))
                assert json.loads(await link.recv())["type"] == ("hello" if welcome else "bye")
    finally:
        assert relay.stop() == 0
