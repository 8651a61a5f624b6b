"""A class name means one thing everywhere."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from pathlib import Path

import pytest

pytestmark = pytest.mark.docs

REPO = Path(__file__).resolve().parent.parent
PACKAGES = (
    "wire/python",
    "wire/typescript/src",
    "edge-agent/src",
    "relay/src",
    "loadtests/src",
    "command/src",
    "spa/src",
)
SOURCES = sorted(
    path
    for package in PACKAGES
    for suffix in ("py", "ts", "tsx")
    for path in (REPO / package).rglob(f"*.{suffix}")
    if not re.search(
        r"/(tests|benches|node_modules|page|demo_bundle)/|__init__", f"/{path.relative_to(REPO)}"
    )
)

# The same thing on both sides of the wire, or of one port.
SAME_MEANING = {
    *("Event", "Frame", "Stream", "Lateness", "Player", "Settings", "TokenBucket"),
    "PolygonCutter",  # reads meshes alike
    *("Page", "Robot", "Viewer"),  # of the load tests: what they play
}


def classes(path: Path) -> list[str]:
    """The public classes of a file."""
    text = path.read_text()
    if path.suffix == ".py":
        return [n.name for n in ast.parse(text).body if isinstance(n, ast.ClassDef) and n.name[0] != "_"]
    return re.findall(r"^(?:export )?(?:abstract )?class (\w+)", text, re.MULTILINE)


def test_a_class_name_has_one_meaning() -> None:
    files: dict[str, set[Path]] = defaultdict(set)
    for path in SOURCES:
        for name in classes(path):
            if path.is_relative_to(REPO / "wire/typescript"):
                continue  # the same codec once more
            files[name].add(path.relative_to(REPO))
    twice = {name for name, found in files.items() if len(found) > 1}
    assert {name: files[name] for name in twice - SAME_MEANING} == {}
    assert twice >= SAME_MEANING, "settled: take it off the list"
