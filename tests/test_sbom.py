"""The SBOMs of the wheels are complete, valid CycloneDX, and can be published."""

from __future__ import annotations

import copy
import json
import tomllib
from typing import Any

import pytest
from cyclonedx.schema import SchemaVersion

from tools.sbom import GUIDE, PAGE, PARTS, ROOT, UV, sbom

pytestmark = [
    pytest.mark.skipif(not UV.exists(), reason="no uv: run make setup"),
    pytest.mark.skipif(not GUIDE.exists(), reason="no built page with a guide: run make setup"),
]


@pytest.fixture(scope="module")
def documents() -> dict[str, dict[str, Any]]:
    """One per wheel."""
    return {package: sbom(package) for package in PARTS}


def test_they_are_cyclonedx(documents: dict[str, dict[str, Any]]) -> None:
    from cyclonedx.validation.json import JsonStrictValidator  # seconds, which every collection would pay

    validator = JsonStrictValidator(SchemaVersion.V1_5)
    for package, document in copy.deepcopy(documents).items():
        for part in document["components"][1:]:  # the validator takes half a second for every address
            part.pop("externalReferences", None)
        for part in document["components"][:1]:
            del part["externalReferences"][1:]
        assert validator.validate_str(json.dumps(document)) is None, package
        assert document["metadata"]["component"]["name"] == package


def test_what_the_relay_needs_and_its_page_holds_is_in_it(documents: dict[str, dict[str, Any]]) -> None:
    relay = {part["name"]: part for part in documents["posecast-relay"]["components"]}
    wanted = tomllib.loads((ROOT / "relay/pyproject.toml").read_text())["project"]["dependencies"]
    assert {name.partition("[")[0].partition("=")[0].strip() for name in wanted} <= relay.keys()
    page = json.loads((ROOT / "spa/package.json").read_text())["dependencies"]
    for name, version in page.items():
        if not name.startswith("@posecast/"):
            assert relay[name]["purl"] == f"pkg:npm/{name.replace('@', '%40')}@{version}"
    assert {"zensical", "iframe-worker", "rxjs"} <= relay.keys(), "the guide's"
    refs = {part["bom-ref"] for part in relay.values()}
    assert {
        ref for node in documents["posecast-relay"]["dependencies"] for ref in node.get("dependsOn", [])
    } <= refs


def test_each_has_a_licence_that_lets_us_hand_it_on(documents: dict[str, dict[str, Any]]) -> None:
    for package, document in documents.items():
        for part in document["components"]:
            told = json.dumps(part.get("licenses", "none: not for this system"))
            assert "GPL" not in told, f"{package} brings {part['name']}: {told}"
            # what is installed here says what it is; the rest is for other systems
            assert "licenses" in part or part["name"] in ELSEWHERE, f"{package}: {part['name']} says nothing"


ELSEWHERE = {"async-timeout", "colorama", "exceptiongroup", "importlib-metadata", "tomli", "zipp"}


def test_the_pages_notices_go_with_it() -> None:
    for part in json.loads(PAGE.read_text()):
        if "MIT" in part["identifier"] and "OR" not in part["identifier"]:
            assert "Permission is hereby granted" in part["text"], part["name"]
    for part in json.loads(GUIDE.read_text()):
        assert part["text"], part["name"]
    for name in ("LICENSE", "NOTICE"):
        assert (PAGE.parent / "docs" / name).stat().st_size > 0
