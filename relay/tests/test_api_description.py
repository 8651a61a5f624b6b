"""/openapi.json: every route says what it answers, and the answers are so."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_relay.http.answers import Readiness, RobotDetails, RobotList, RobotState
from posecast_testing import until

from .stage import Relay
from .test_admin import Lab


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
